// The picture with what is drawn on it: it draws the outlines, and turns what mouse, finger or pen does into changes.

import { isInside, middle, OPEN } from "./outlines.js";

const SVG = "http://www.w3.org/2000/svg";
const REACH_PX = { mouse: 10, pen: 12, touch: 22 }; // on the screen: so far beside a corner it is still meant
const CORNER_PX = 6;
const STILL_PX = 6; // a corner that moves less was only touched

export class Surface {
  #held = null; // { corner, from, moved }: what the pointer that is down has got hold of
  #ahead = null; // where the next corner would be

  constructor(area, canvas, svg, outlines) {
    [this.area, this.canvas, this.svg, this.outlines] = [area, canvas, svg, outlines];
    area.addEventListener("pointerdown", (event) => this.#down(event));
    area.addEventListener("pointermove", (event) => this.#move(event));
    area.addEventListener("pointerup", (event) => this.#up(event));
    area.addEventListener("pointercancel", () => this.#cancel()); // two fingers zoom
    area.addEventListener("pointerleave", () => this.#look(null));
    new ResizeObserver(() => this.draw()).observe(area);
  }

  show(image) {
    const { width, height } = image;
    if (this.canvas.width !== width || this.canvas.height !== height) {
      [this.canvas.width, this.canvas.height] = [width, height];
      this.area.style.setProperty("--aspect", width / height);
      this.svg.setAttribute("viewBox", `-0.5 -0.5 ${width} ${height}`);
    }
    this.canvas.getContext("2d").drawImage(image, 0, 0);
    image.close();
  }

  // Nearest px of the image, also from beside it.
  place({ clientX, clientY }) {
    const { x, y } = new DOMPoint(clientX, clientY).matrixTransform(this.svg.getScreenCTM().inverse());
    const inside = (value, size) => Math.round(100 * Math.min(Math.max(value, 0), size - 1)) / 100;
    return [inside(x, this.canvas.width), inside(y, this.canvas.height)];
  }

  #down(event) {
    if (!event.isPrimary || event.button !== 0) return;
    this.area.setPointerCapture(event.pointerId);
    const corner = this.#grab(event);
    this.#held = { corner, from: [event.clientX, event.clientY], moved: false };
  }

  // Return the corner under the pointer, a new one if it is between two; null: none.
  #grab(event) {
    const { outlines } = this;
    const outline = outlines.current;
    if (outline === null) return null;
    const corners = outlines.corners(outline);
    const corner = this.#nearest(event, corners);
    if (corner !== null) {
      outlines.choose(outline, corner);
      outlines.remember();
      return { outline, corner };
    }
    if (outline === OPEN) return null;
    const between = this.#nearest(event, betweens(corners));
    if (between === null) return null;
    outlines.insert({ outline, corner: between + 1 }, this.place(event));
    return { outline, corner: between + 1, isNew: true };
  }

  #nearest(event, places) {
    const reach = (REACH_PX[event.pointerType] ?? REACH_PX.mouse) * this.#pxPerScreenPx() / (visualViewport?.scale ?? 1);
    const [x, y] = this.place(event);
    const far = places.map(([cornerX, cornerY]) => Math.hypot(cornerX - x, cornerY - y));
    const least = Math.min(...far);
    return least <= reach ? far.indexOf(least) : null;
  }

  #move(event) {
    if (!event.isPrimary) return;
    const held = this.#held;
    if (!held) {
      this.#look(event.pointerType === "mouse" ? this.place(event) : null);
      return;
    }
    held.moved ||= Math.hypot(event.clientX - held.from[0], event.clientY - held.from[1]) > STILL_PX;
    if (held.corner && held.moved) this.outlines.move(held.corner, this.place(event));
    else this.#look(this.place(event));
  }

  #up(event) {
    if (!event.isPrimary || !this.#held) return;
    const { corner, moved } = this.#held;
    this.#held = null;
    const { outlines } = this;
    if (corner) {
      if (moved || corner.isNew) return;
      outlines.forget();
      if (corner.outline === OPEN && corner.corner === 0) outlines.close();
      outlines.changed();
      return;
    }
    const at = this.place(event);
    const inside = outlines.open.length ? -1 : outlines.closed.findLastIndex((corners) => isInside(at, corners));
    if (inside >= 0 && !moved) outlines.choose(inside);
    else outlines.add(at);
  }

  #cancel() {
    if (this.#held?.corner) this.outlines.undo();
    this.#held = null;
    this.#look(null);
  }

  #look(at) {
    this.#ahead = at;
    if (this.outlines.open.length) this.draw();
  }

  draw() {
    const { outlines, svg } = this;
    const shapes = outlines.proposed.flatMap((corners) => polygon(corners, "proposed"));
    outlines.closed.forEach((corners, at) => {
      shapes.push(...polygon(corners, at === outlines.current ? "drawn chosen" : "drawn"));
    });
    if (outlines.open.length) {
      if (this.#ahead && !this.#held?.corner) shapes.push(shape("polyline", { points: points([outlines.open.at(-1), this.#ahead]), class: "ahead" }));
      for (const kind of ["halo", "open"]) shapes.push(shape("polyline", { points: points(outlines.open), class: kind }));
    }
    shapes.push(...this.#handles());
    svg.replaceChildren(...shapes);
    const count = outlines.closed.length;
    svg.setAttribute("aria-label", `${count} ${count === 1 ? "outline" : "outlines"}, ${outlines.proposed.length} proposed`);
  }

  #handles() {
    const outline = this.outlines.current;
    if (outline === null) return [];
    const r = CORNER_PX * this.#pxPerScreenPx();
    const corners = this.outlines.corners(outline);
    const chosen = this.outlines.chosen?.outline === outline ? this.outlines.chosen.corner : null;
    const between = outline === OPEN ? [] : betweens(corners);
    return [
      ...between.map(([cx, cy]) => shape("circle", { cx, cy, r: 0.6 * r, class: "between" })),
      ...corners.map(([cx, cy], at) => shape("circle", { cx, cy, r, class: at === chosen ? "corner chosen" : "corner" })),
    ];
  }

  #pxPerScreenPx() {
    return this.canvas.width / Math.max(this.svg.clientWidth, 1);
  }
}

function betweens(corners) {
  return corners.map((corner, at) => middle(corner, corners[(at + 1) % corners.length]));
}

function polygon(corners, kind) {
  return ["halo", kind].map((one) => shape("polygon", { points: points(corners), class: one }));
}

function points(corners) {
  return corners.map((corner) => corner.join()).join(" ");
}

function shape(name, attributes) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}
