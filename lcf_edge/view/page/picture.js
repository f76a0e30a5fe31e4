// The picture: a preview's two panels, or one of them with ψ drawn on top; without previews the scene alone.

const FRESH_MS = 2500;
const LARGEST_PX = 8192; // of a side of the canvas, whatever a scene says
const BEHIND_S = 0.25; // pictures come after everything else
const COLOURS = { rebel: "#ff5a5a", normal: "#46d746", psi: "#ffe100", text: "#ffffff" };
const KEYS = {
  circles: "Green: normal circles, red: rebels with cause and time to contact, yellow: ψ, cross: focus of expansion.",
  corners: "Yellow dots: corners, red dots: omitted by ψ, blue: estimated edges, green lines: flow groups, yellow: ψ.",
  both: "Left: corners (yellow, red where ψ omits them), edges (blue), groups (green), ψ. Right: circles (green), rebels (red), focus of expansion (cross).",
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

  take(image, from, scene, gaveUp) {
    if (image) {
      this.#image?.close();
      [this.#image, this.#from, this.#at] = [image, from, performance.now()];
    }
    [this.#scene, this.#gaveUp] = [scene, gaveUp];
    this.draw();
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
      ? "No pictures: the daemon gave up the preview to save memory (memory.budget_mib)."
      : "No pictures come (is publish.preview_hz 0?). Drawn from the scene alone.";
    const behind_s = this.#image && live && !alone ? (this.#scene.stamp_ns - this.#from.stamp_ns) / 1e9 : 0;
    this.behind.hidden = behind_s < BEHIND_S;
    this.behind.textContent = `picture ${behind_s.toFixed(1)} s behind`;
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
    const context = this.#sized(Math.min(scene.image_width, LARGEST_PX), Math.min(scene.image_height, LARGEST_PX));
    context.fillStyle = "#10161c";
    context.fillRect(0, 0, scene.image_width, scene.image_height);
    drawPsi(context, scene.psi);
    drawCircles(context, scene.circles);
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
    this.canvas.setAttribute("aria-label", `Camera picture with ${rebels} rebel and ${normal} normal circles`);
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

function drawCircles(context, circles) {
  context.font = "15px system-ui, sans-serif";
  context.textAlign = "center";
  for (const circle of circles) {
    context.strokeStyle = COLOURS[circle.kind];
    context.lineWidth = circle.kind === "rebel" ? 3 : 1.5;
    context.beginPath();
    context.arc(circle.x, circle.y, Math.max(circle.r, 1), 0, 2 * Math.PI);
    context.stroke();
    if (circle.kind !== "rebel") continue;
    context.fillStyle = COLOURS.text;
    const contact = circle.ttc_s === null ? "" : ` ${circle.ttc_s.toFixed(1)} s`;
    const text = circle.cause + contact;
    const half = context.measureText(text).width / 2 + 2;
    const x = Math.min(Math.max(circle.x, half), context.canvas.width - half);
    context.fillText(text, x, Math.max(circle.y - circle.r - 6, 14));
  }
}
