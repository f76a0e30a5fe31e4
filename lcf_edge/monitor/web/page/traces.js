// Plots of the last minutes, one point a second: values to the left, times below; for each table one of its own.

const SPAN_S = 300;
const MIN_S = 5;
const GAP_S = 5; // no line is drawn across
const MARGIN = { left: 34, right: 8, top: 8, bottom: 18 }; // px, for what is written beside the axes
const LABEL_GAP = 12; // px, between two times
const STEPS_S = [1, 2, 5, 10, 30, 60, 120];
const field = (name) => (point) => point[name];

const PLOTS = [
  ["Scenes a second", 1, [["", "first", field("rate_hz")]]],
  ["Latency, ms", 1, [["half below", "first", field("latency_p50_ms")], ["99 % below", "second", field("latency_p99_ms")]]],
  ["Computing, half below, ms", 1, [["corners", "first", field("detect_p50_ms")], ["filter", "normal", field("filter_p50_ms")]]],
  ["Memory, MiB", 0, [["resident", "first", field("resident_mib")], ["budget", "error", field("budget_mib")]]],
  ["Objects and circles", 0, [["objects", "object", field("objects")], ["rebel", "rebel", field("rebels")], ["normal", "normal", field("normals")], ["ψ", "psi", field("psi")]]],
  ["Temperature, °C", 0, [["", "third", field("temperature_c")]]],
];
const TABLES = {
  objects: "Objects", corners: "Corners", edges_normal: "Normal edges", edges_rebel: "Rebel edges", chains: "Chains α",
  circles_normal: "Normal circles", circles_rebel: "Rebel circles", groups: "Groups λ", psi: "Regions ψ",
};

export class Traces {
  #points = [];
  #began_ns = null; // of a recording; null: times are those of the clock

  constructor(box, tables) {
    this.plots = PLOTS.map(([title, digits, lines]) => plot(box, title, digits, lines));
    for (const [table, title] of Object.entries(TABLES)) {
      const rows = (point) => point.fill[table]?.[0] ?? null;
      const capacity = (point) => point.fill[table]?.[1] ?? null;
      const one = plot(tables, title, 0, [["", "first", rows], ["of", "error", capacity]]);
      one.figure.className = "small";
      this.plots.push(one);
    }
    this.draw();
  }

  beginning(began_ns) {
    this.#began_ns = began_ns;
  }

  add(points) {
    const all = [...this.#points.filter((point) => point.at_ns < points[0].at_ns), ...points];
    const newest = all.at(-1).at_ns;
    this.#points = all.filter((point) => newest - point.at_ns <= SPAN_S * 1e9);
    this.draw();
  }

  draw() {
    const colours = getComputedStyle(document.documentElement);
    const newest_ns = this.#points.at(-1)?.at_ns ?? 0;
    const oldest_ns = this.#began_ns ?? this.#points[0]?.at_ns ?? 0;
    const span_s = Math.min(Math.max((newest_ns - oldest_ns) / 1e9, MIN_S), SPAN_S);
    for (const { figure, canvas, legends, digits, lines } of this.plots) {
      const series = lines.map(([, , value]) => this.#points.map(value));
      figure.hidden = this.#points.length === 0 || series.every((values) => values.every((value) => value === null));
      if (figure.hidden) continue;
      series.forEach((values, at) => {
        const value = values.at(-1) ?? null;
        legends[at].textContent = `${lines[at][0]} ${value === null ? "-" : value.toFixed(digits)}`.trim();
      });
      const ratio = devicePixelRatio || 1;
      const [width, height] = [canvas.clientWidth, canvas.clientHeight];
      [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
      const context = canvas.getContext("2d");
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      const top = round(Math.max(1, ...series.flat().map((value) => value ?? 0)));
      const x = (at_ns) => width - MARGIN.right - ((newest_ns - at_ns) / 1e9 / span_s) * (width - MARGIN.left - MARGIN.right);
      const y = (value) => height - MARGIN.bottom - (value / top) * (height - MARGIN.top - MARGIN.bottom);
      this.#axes(context, { x, y, top, width, height, newest_ns, span_s }, colours);
      context.lineWidth = 1.5;
      series.forEach((values, at) => {
        context.strokeStyle = colours.getPropertyValue(`--${lines[at][1]}`);
        this.#line(context, values, x, y);
      });
    }
  }

  #axes(context, { x, y, top, width, height, newest_ns, span_s }, colours) {
    context.font = "11px system-ui, sans-serif";
    context.fillStyle = colours.getPropertyValue("--quiet");
    context.strokeStyle = colours.getPropertyValue("--line");
    context.lineWidth = 1;
    context.textAlign = "right";
    for (const value of [0, top / 2, top]) {
      line(context, MARGIN.left, y(value), width - MARGIN.right, y(value));
      context.fillText(Number(value.toPrecision(3)), MARGIN.left - 4, y(value) + 4);
    }
    context.textAlign = "center";
    const zero_ns = this.#began_ns ?? 60e9 * Math.floor(newest_ns / 60e9);
    const label = (at_ns, step_s) =>
      this.#began_ns === null ? clock(at_ns, step_s) : `${Math.round((at_ns - zero_ns) / 1e9)} s`;
    const needed = (step_s) => context.measureText(label(newest_ns, step_s)).width + LABEL_GAP;
    const step_s = STEPS_S.find((one) => x(newest_ns + one * 1e9) - x(newest_ns) >= needed(one)) ?? STEPS_S.at(-1);
    let free = width; // where the label to the right begins, the first one where the plot ends
    for (let at = Math.floor((newest_ns - zero_ns) / 1e9 / step_s); ; at -= 1) {
      const at_ns = zero_ns + at * step_s * 1e9;
      if (at_ns < newest_ns - span_s * 1e9) break;
      line(context, x(at_ns), height - MARGIN.bottom, x(at_ns), height - MARGIN.bottom + 4);
      const text = label(at_ns, step_s);
      const half = context.measureText(text).width / 2;
      const middle = Math.min(Math.max(x(at_ns), half), width - half);
      if (middle + half > free) continue;
      context.fillText(text, middle, height - 3);
      free = middle - half - LABEL_GAP / 2;
    }
  }

  #line(context, values, x, y) {
    let last_ns = null;
    context.beginPath();
    values.forEach((value, at) => {
      const { at_ns } = this.#points[at];
      if (value === null) return;
      if (last_ns !== null && at_ns - last_ns < GAP_S * 1e9) context.lineTo(x(at_ns), y(value));
      else context.moveTo(x(at_ns) - 1, y(value));
      last_ns = at_ns;
    });
    context.stroke();
  }
}

function plot(box, title, digits, lines) {
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
}

// Up to 1, 2 or 5 times a power of ten.
function round(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= value);
}

function line(context, ...[fromX, fromY, toX, toY]) {
  context.beginPath();
  context.moveTo(fromX, fromY);
  context.lineTo(toX, toY);
  context.stroke();
}

function clock(at_ns, step_s) {
  const time = new Date(at_ns / 1e6);
  const shown = { hour: "2-digit", minute: "2-digit", ...(step_s < 60 && { second: "2-digit" }), hourCycle: "h23" };
  return time.toLocaleTimeString([], shown);
}
