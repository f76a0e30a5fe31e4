// From above: the vehicle at the foot, what is known of objects by range and bearing, the way that it takes, and how far
// it comes within the horizon.

import { isMet, objectsInOrder, thingName } from "./tables.js";
import { outlined } from "./writing.js";

const HEIGHT = 260;
const MIN_M = 4; // is shown ahead, and RANGES at most
const RANGES = [5, 10, 20, 40, 80, 160];
const MARGIN = 22; // below the vehicle

export class TopDown {
  #scene = null;
  #ahead = null;

  constructor(canvas, note) {
    this.canvas = canvas;
    this.note = note;
  }

  take(scene, ahead) {
    [this.#scene, this.#ahead] = [scene, ahead];
    this.draw();
  }

  draw() {
    const scene = this.#scene;
    if (!scene) return;
    const colours = getComputedStyle(document.documentElement);
    const colour = (name) => colours.getPropertyValue(`--${name}`);
    const ratio = devicePixelRatio || 1;
    const width = this.canvas.clientWidth;
    [this.canvas.width, this.canvas.height] = [Math.round(width * ratio), Math.round(HEIGHT * ratio)];
    const context = this.canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.font = "13px system-ui, sans-serif";

    const placed = objectsInOrder(scene.objects).filter(({ range_m, bearing }) => range_m !== null && bearing !== null);
    const horizon_m = this.#ahead && scene.speed !== null ? Math.abs(scene.speed) * this.#ahead.horizon_s : null;
    const wanted_m = Math.max(MIN_M, (horizon_m ?? 0) * 1.1, ...placed.map(({ range_m }) => range_m * 1.1));
    const farthest_m = RANGES.find((range_m) => range_m >= wanted_m) ?? RANGES.at(-1);
    const scale = (HEIGHT - MARGIN - 8) / farthest_m;
    const at = (forward_m, right_m) => [width / 2 + right_m * scale, HEIGHT - MARGIN - forward_m * scale];

    this.#rings(context, at, scale, farthest_m, colour("line"), colour("quiet"));
    if (this.#ahead) this.#way(context, at, this.#ahead.half_width_m, horizon_m, farthest_m, colour("accent"));
    vehicle(context, at, scale, this.#ahead?.half_width_m ?? 0.3, colour("text"));
    for (const thing of [...placed].reverse()) object(context, at, thing, colour(isMet(thing) ? "met" : "object"), colour("card"));

    const unplaced = scene.objects.length - placed.length;
    const parts = [`${farthest_m} m ahead`];
    if (this.#ahead) parts.push(`way ${(2 * this.#ahead.half_width_m).toFixed(2)} m wide, horizon ${this.#ahead.horizon_s} s${horizon_m === null ? "" : ` (${horizon_m.toFixed(1)} m)`}`);
    if (unplaced) parts.push(`${unplaced} without range`);
    this.note.textContent = parts.join(" · ");
    this.canvas.setAttribute("aria-label", `From above: ${placed.map((thing) => `${thingName(thing)} ${thing.range_m.toFixed(1)} m ahead`).join(", ") || "nothing"}`);
  }

  #rings(context, at, scale, farthest_m, line, text) {
    const step_m = farthest_m / 5;
    context.lineWidth = 1;
    for (let range_m = step_m; range_m < farthest_m * 1.01; range_m += step_m) {
      const [, y] = at(range_m, 0);
      context.strokeStyle = line;
      context.beginPath();
      context.moveTo(0, y);
      context.lineTo(this.canvas.clientWidth, y);
      context.stroke();
      context.fillStyle = text;
      context.textAlign = "left";
      context.fillText(`${range_m} m`, 4, y + 13);
    }
  }

  #way(context, at, half_width_m, horizon_m, farthest_m, colour) {
    context.strokeStyle = context.fillStyle = colour;
    context.lineWidth = 1.5;
    if (horizon_m !== null) {
      const [[left, top], [right, bottom]] = [at(horizon_m, -half_width_m), at(0, half_width_m)];
      context.globalAlpha = 0.15;
      context.fillRect(left, top, right - left, bottom - top);
      context.globalAlpha = 1;
      context.strokeRect(left, top, right - left, bottom - top);
    }
    context.setLineDash([6, 4]);
    for (const side of [-half_width_m, half_width_m]) {
      context.beginPath();
      context.moveTo(...at(0, side));
      context.lineTo(...at(farthest_m, side));
      context.stroke();
    }
    context.setLineDash([]);
  }
}

function vehicle(context, at, scale, half_width_m, colour) {
  const [x, y] = at(0, 0);
  const half = Math.max(half_width_m * scale, 5);
  context.fillStyle = colour;
  context.beginPath();
  context.moveTo(x, y - 2);
  context.lineTo(x + half, y + 14);
  context.lineTo(x - half, y + 14);
  context.fill();
}

// Range is along the optical axis: to the side it is range times the tangent of the bearing. The line is one standard
// deviation of the range to both sides.
function object(context, at, thing, colour, halo) {
  const right = Math.tan(thing.bearing);
  const [x, y] = at(thing.range_m, thing.range_m * right);
  const sigma_m = Math.min(thing.range_sigma_m ?? 0, thing.range_m);
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(...at(thing.range_m - sigma_m, (thing.range_m - sigma_m) * right));
  context.lineTo(...at(thing.range_m + sigma_m, (thing.range_m + sigma_m) * right));
  context.stroke();
  context.beginPath();
  context.arc(x, y, 6, 0, 2 * Math.PI);
  if (thing.state === "seen") context.fill();
  else context.stroke();
  const contact = thing.ttc_s === null ? "" : ` ${thing.ttc_s.toFixed(1)} s`;
  outlined(context, thingName(thing) + contact, x, y - 10, colour, halo);
}
