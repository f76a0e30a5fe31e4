// Plots of the last minutes, one point a second.

const SPAN_S = 300;
const GAP_S = 5; // no line is drawn across
const share = (table) => ({ fill }) => (fill[table] ? (100 * fill[table][0]) / fill[table][1] : null);
const field = (name) => (point) => point[name];

const PLOTS = [
  ["Scenes a second", 1, [["", "first", field("rate_hz")]]],
  ["Latency, ms", 1, [["half below", "first", field("latency_p50_ms")], ["99 % below", "second", field("latency_p99_ms")]]],
  ["Of that, half below, ms", 1, [["corners", "first", field("detect_p50_ms")], ["filter", "normal", field("filter_p50_ms")]]],
  ["Memory, MiB", 0, [["resident", "first", field("resident_mib")], ["budget", "error", field("budget_mib")]]],
  ["Circles", 0, [["rebel", "rebel", field("rebels")], ["normal", "normal", field("normals")], ["ψ", "psi", field("psi")]]],
  ["Tables, % full", 0, [
    ["corners", "first", share("corners")], ["edges", "normal", share("edges_normal")],
    ["rebel edges", "rebel", share("edges_rebel")], ["chains", "second", share("chains")],
    ["groups", "third", share("groups")], ["ψ", "psi", share("psi")],
  ]],
  ["Temperature, °C", 0, [["", "third", field("temperature_c")]]],
];

export class Traces {
  #points = [];

  constructor(box) {
    this.plots = PLOTS.map(([title, digits, lines]) => {
      const figure = box.appendChild(document.createElement("figure"));
      const caption = figure.appendChild(document.createElement("figcaption"));
      caption.appendChild(document.createElement("b")).textContent = title;
      const canvas = figure.appendChild(document.createElement("canvas"));
      canvas.setAttribute("aria-hidden", "true"); // the caption has the newest figures
      const legends = lines.map(([, colour]) => {
        const legend = caption.appendChild(document.createElement("span"));
        legend.style.color = `var(--${colour})`;
        return legend;
      });
      return { figure, canvas, legends, digits, lines };
    });
    this.draw();
  }

  add(points) {
    const all = [...this.#points.filter((point) => point.at_ns < points[0].at_ns), ...points];
    const newest = all.at(-1).at_ns;
    this.#points = all.filter((point) => newest - point.at_ns <= SPAN_S * 1e9);
    this.draw();
  }

  draw() {
    const colours = getComputedStyle(document.documentElement);
    for (const { figure, canvas, legends, digits, lines } of this.plots) {
      const series = lines.map(([, , value]) => this.#points.map(value));
      figure.hidden = this.#points.length > 0 && series.every((values) => values.every((value) => value === null));
      const top = Math.max(1, ...series.flat().map((value) => value ?? 0)) * 1.1;
      const ratio = devicePixelRatio || 1;
      const [width, height] = [canvas.clientWidth * ratio, canvas.clientHeight * ratio].map(Math.round);
      if (canvas.width !== width) canvas.width = width;
      if (canvas.height !== height) canvas.height = height;
      const context = canvas.getContext("2d");
      context.clearRect(0, 0, width, height);
      context.lineWidth = 1.5 * ratio;
      series.forEach((values, at) => {
        const [name, colour] = lines[at];
        const value = values.at(-1) ?? null;
        legends[at].textContent = `${name} ${value === null ? "-" : value.toFixed(digits)}`.trim();
        context.strokeStyle = colours.getPropertyValue(`--${colour}`);
        this.#line(context, values, width, height, top);
      });
      context.fillStyle = colours.getPropertyValue("--quiet");
      context.font = `${11 * ratio}px system-ui, sans-serif`;
      context.fillText(top >= 10 ? top.toFixed(0) : top.toFixed(1), 4 * ratio, 12 * ratio);
    }
  }

  #line(context, values, width, height, top) {
    const newest = this.#points.at(-1)?.at_ns ?? 0;
    let last = null;
    context.beginPath();
    values.forEach((value, at) => {
      const before_s = (newest - this.#points[at].at_ns) / 1e9;
      if (value === null) return;
      const x = width * (1 - before_s / SPAN_S);
      const y = height * (1 - value / top);
      if (last !== null && last - before_s < GAP_S) context.lineTo(x, y);
      else context.moveTo(x, y);
      last = before_s;
    });
    context.stroke();
  }
}
