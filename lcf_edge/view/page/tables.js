// Circles and devices as text; rows and devices are kept and only changed, so that what is open stays open.

const DEGREES = 180 / Math.PI;
const figure = (value, digits, factor = 1) => (value === null ? "-" : (value * factor).toFixed(digits));

const COLUMNS = [
  (circle) => (circle.kind === "rebel" ? name(circle) : "normal"),
  (circle) => figure(circle.ttc_s, 1),
  (circle) => figure(circle.bearing, 1, DEGREES),
  (circle) => figure(circle.range_m, 1),
  (circle) => figure(circle.lateral_m, 1),
  (circle) => String(circle.support),
  (circle) => figure(circle.trust, 1),
  (circle) => String(circle.id),
];

function name({ cause }) {
  return cause === "none" ? "rebel" : cause;
}

function ordered(circles) {
  const contact = ({ kind, ttc_s }) => (kind === "rebel" ? (ttc_s ?? 1e9) : Infinity);
  return circles.toSorted?.((a, b) => compare(contact(a), contact(b)) || a.id - b.id)
    ?? [...circles].sort((a, b) => compare(contact(a), contact(b)) || a.id - b.id);
}

function compare(a, b) {
  return a === b ? 0 : a < b ? -1 : 1;
}

export function urgent(scene) {
  const first = ordered(scene.circles)[0];
  return first?.kind === "rebel" ? first : null;
}

export function words(circle) {
  const parts = [name(circle)];
  if (circle.ttc_s !== null) parts.push(`contact in ${circle.ttc_s.toFixed(1)} s`);
  if (circle.range_m !== null) parts.push(`${circle.range_m.toFixed(1)} m`);
  if (circle.bearing !== null) parts.push(`${Math.abs(circle.bearing * DEGREES).toFixed(0)}° ${circle.bearing < 0 ? "left" : "right"}`);
  return parts.map((part) => part.replaceAll(" ", "\u00a0")).join(" · ");
}

export function showCircles(body, count, scene) {
  const circles = scene ? ordered(scene.circles) : [];
  const rebels = circles.filter(({ kind }) => kind === "rebel").length;
  count.textContent = scene ? `${rebels} rebel, ${circles.length - rebels} normal, ${scene.psi.length} ψ` : "";
  while (body.rows.length > circles.length) body.deleteRow(-1);
  circles.forEach((circle, at) => {
    const row = body.rows[at] ?? body.insertRow();
    row.className = circle.kind;
    COLUMNS.forEach((column, of) => set(row.cells[of] ?? row.insertCell(), column(circle)));
  });
}

export function showDevices(box, status) {
  box.querySelector(":scope > p")?.remove();
  const shown = new Map([...box.children].map((element) => [element.dataset.name, element]));
  const kept = new Set();
  for (const one of status) {
    const element = shown.get(one.name) ?? box.appendChild(device(one.name));
    shown.delete(one.name);
    kept.add(element);
    const [, level, message] = element.firstElementChild.children;
    level.dataset.level = one.level;
    set(level, one.level);
    set(message, one.message);
    const values = element.lastElementChild;
    const texts = Object.entries(one.values).flat();
    while (values.children.length > texts.length) values.lastElementChild.remove();
    texts.forEach((text, at) => set(values.children[at] ?? values.appendChild(make(at % 2 ? "dd" : "dt")), text));
  }
  [...box.children].forEach((element) => kept.has(element) || element.remove());
}

function device(title) {
  const element = make("details");
  element.dataset.name = title;
  const summary = element.appendChild(make("summary"));
  summary.append(make("b", title), make("span"), make("span"));
  element.append(make("dl"));
  return element;
}

function make(tag, text = "") {
  const element = document.createElement(tag);
  element.textContent = text;
  return element;
}

function set(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
