// The picture: a preview's two panels, or one of them with ψ drawn on top; without previews the scene alone.

import { isMet, objectsInOrder, thingName } from "./tables.js";
import { outlined } from "./writing.js";

const FRESH_MS = 2500;
const MAX_PX = 8192; // of a side of the canvas, whatever a scene says
const BEHIND_S = 0.25; // pictures come after everything else
const COLOURS = { rebel: "#ff5a5a", normal: "#46d746", psi: "#ffe100", text: "#ffffff", outline: "#000000", met: "#ffa028", passes: "#6ed7ff" };
const KEYS = {
  circles: "Boxes: objects with time to contact, orange if it will probably be met, dashed if it is not seen. Green: normal circles, red: rebels, yellow: ψ, cross: focus of expansion.",
  corners: "Yellow dots: corners, red dots: omitted by ψ, blue: estimated edges, green lines: flow groups, yellow: ψ.",
  both: "Left: corners (yellow, red where ψ omits them), edges (blue), groups (green), ψ. Right: objects (boxes), circles (green), rebels (red), focus of expansion (cross).",
};

export class Picture {
  #image = null;
  #from = null; // what is known of the image
  #at = -Infinity;
  #began = performance.now();
  #scene = null;
  #gaveUp = false;
  #panel = "circles";
  #labelled = -Infinity;

  constructor(canvas, why, behind, key) {
    this.canvas = canvas;
    this.why = why;
    this.behind = behind;
    this.key = key;
  }

  choose(panel) {
    this.#panel = panel;
    this.key.textContent = KEYS[panel];
    this.draw();
  }

  take(image, from, scene, gaveUp, paused = false) {
    if (image) {
      this.#image?.close();
      [this.#image, this.#from, this.#at] = [image, from, performance.now()];
    }
    if (paused) this.#at = performance.now(); // no other picture is to come
    [this.#scene, this.#gaveUp] = [scene, gaveUp];
    this.draw();
  }

  // The scene of which the picture was made, while it is little behind: what is told beside it are the same numbers.
  shown(scene) {
    const its = this.#from?.scene;
    if (!scene || !its || performance.now() - this.#at > FRESH_MS) return scene;
    const behind_s = (scene.stamp_ns - its.stamp_ns) / 1e9;
    return behind_s >= 0 && behind_s < BEHIND_S ? { ...scene, ...its } : scene;
  }

  // As a PNG, which is downloaded.
  save() {
    if (!this.#scene) return;
    this.canvas.toBlob((png) => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(png);
      link.download = `lcf-edge-picture-${(this.#from ?? this.#scene).stamp_ns}.png`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  }

  draw() {
    const live = this.#scene && this.#scene.age_s < 1;
    const late = performance.now() - this.#at > FRESH_MS;
    const alone = live && late; // scenes come, pictures do not
    if (this.#image && !alone) this.#drawImage();
    else if (this.#scene) this.#drawScene();
    if (!this.#image && !this.#scene) return;
    this.why.hidden = !alone || performance.now() - this.#began < FRESH_MS;
    this.why.textContent = this.#gaveUp
      ? "No images: the daemon gave up the preview to save memory (memory.budget_mib)."
      : "No images arrive: publish.preview_hz is 0, or a replay publishes, which sends none. Drawn from the scene alone.";
    const behind_s = this.#image && live && !alone ? (this.#scene.stamp_ns - this.#from.stamp_ns) / 1e9 : 0;
    this.behind.hidden = behind_s < BEHIND_S;
    this.behind.textContent = `image ${behind_s.toFixed(1)} s behind`;
    this.#label();
  }

  #drawImage() {
    const image = this.#image;
    const width = image.width / 2;
    const both = this.#panel === "both";
    const context = this.#sized(both ? image.width : width, image.height);
    context.drawImage(image, this.#panel === "circles" ? -width : 0, 0);
    if (this.#panel === "circles" && this.#from.scene) drawPsi(context, this.#from.scene.psi);
  }

  #drawScene() {
    const scene = this.#scene;
    const context = this.#sized(Math.min(scene.image_width, MAX_PX), Math.min(scene.image_height, MAX_PX));
    context.fillStyle = "#10161c";
    context.fillRect(0, 0, scene.image_width, scene.image_height);
    drawPsi(context, scene.psi);
    drawCircles(context, scene.circles, scene.objects.length === 0);
    drawObjects(context, scene.objects);
  }

  #sized(width, height) {
    if (this.canvas.width !== width) this.canvas.width = width;
    if (this.canvas.height !== height) this.canvas.height = height;
    return this.canvas.getContext("2d");
  }

  #label() {
    if (performance.now() - this.#labelled < 1000 || !this.#scene) return;
    this.#labelled = performance.now();
    const rebels = this.#scene.circles.filter(({ kind }) => kind === "rebel").length;
    const normal = this.#scene.circles.length - rebels;
    const objects = this.#scene.objects.length;
    this.canvas.setAttribute("aria-label", `Camera image with ${objects} objects, ${rebels} rebel and ${normal} normal circles`);
  }
}

function drawPsi(context, regions) {
  context.strokeStyle = COLOURS.psi;
  context.lineWidth = 1.5;
  context.setLineDash([6, 4]);
  for (const region of regions) {
    context.beginPath();
    if (region.shape === "circle") context.arc(region.x, region.y, Math.max(region.r, 0), 0, 2 * Math.PI);
    else context.rect(region.x - region.w / 2, region.y - region.h / 2, region.w, region.h);
    context.stroke();
  }
  context.setLineDash([]);
}

function drawCircles(context, circles, labelled) {
  for (const circle of circles) {
    context.strokeStyle = COLOURS[circle.kind];
    context.lineWidth = circle.kind === "rebel" ? 3 : 1.5;
    context.beginPath();
    context.arc(circle.x, circle.y, Math.max(circle.r, 1), 0, 2 * Math.PI);
    context.stroke();
    if (circle.kind !== "rebel" || !labelled) continue;
    const contact = circle.ttc_s === null ? "" : ` ${circle.ttc_s.toFixed(1)} s`;
    write(context, circle.cause + contact, circle.x, circle.y - circle.r, COLOURS.text);
  }
}

function drawObjects(context, objects) {
  for (const thing of objectsInOrder(objects).reverse()) { // the most urgent on top
    const seen = thing.state === "seen";
    context.strokeStyle = isMet(thing) ? COLOURS.met : COLOURS.passes;
    context.lineWidth = seen ? 3 : 1.5;
    context.setLineDash(seen ? [] : [7, 5]);
    context.strokeRect(thing.x - thing.w / 2, thing.y - thing.h / 2, thing.w, thing.h);
    context.setLineDash([]);
    const sigma = thing.ttc_sigma_s === null ? "" : ` ±${thing.ttc_sigma_s.toFixed(1)}`;
    const contact = thing.ttc_s === null ? "" : ` ${thing.ttc_s.toFixed(1)}${sigma} s`;
    write(context, thingName(thing) + contact, thing.x, thing.y - thing.h / 2, isMet(thing) ? COLOURS.met : COLOURS.passes);
  }
}

function write(context, text, x, top, colour) {
  context.font = "15px system-ui, sans-serif";
  outlined(context, text, x, top - 6, colour, COLOURS.outline);
}
