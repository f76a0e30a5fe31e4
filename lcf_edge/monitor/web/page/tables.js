// Objects, circles and devices as text; rows and devices are kept and only changed, so that what is open stays open.

const DEGREES = 180 / Math.PI;
const PROBABLY = 0.5;
const decimals = (value, digits) => value.toFixed(digits).replace(/^-(0(\.0+)?)$/, "$1"); // no minus before nothing
const figure = (value, digits, factor = 1) => (value === null ? "-" : decimals(value * factor, digits));
const spread = (sigma) => (sigma === null ? "" : ` ±${sigma.toFixed(1)}`);
const measured = (value, sigma) => (value === null ? "-" : decimals(value, 1) + spread(sigma));

const OBJECT_COLUMNS = [
  (thing) => thingName(thing) + (thing.state === "seen" ? "" : ` (${thing.state})`),
  (thing) => measured(thing.ttc_s, thing.ttc_sigma_s),
  (thing) => figure(thing.probability, 0, 100),
  (thing) => measured(thing.range_m, thing.range_sigma_m),
  (thing) => measured(thing.lateral_m, thing.lateral_sigma_m),
  (thing) => figure(thing.bearing, 1, DEGREES),
  (thing) => `${figure(thing.v_forward_mps, 1)}, ${figure(thing.v_right_mps, 1)}`,
  (thing) => String(thing.id),
];
const CIRCLE_COLUMNS = [
  (circle) => (circle.kind === "rebel" ? circleName(circle) : "normal"),
  (circle) => figure(circle.ttc_s, 1),
  (circle) => figure(circle.bearing, 1, DEGREES),
  (circle) => figure(circle.range_m, 1),
  (circle) => figure(circle.lateral_m, 1),
  (circle) => String(circle.support),
  (circle) => figure(circle.trust, 1),
  (circle) => String(circle.id),
];

export const thingName = (thing) => thing.class.replace("_", " ");
export const isMet = ({ probability }) => probability >= PROBABLY;
const circleName = ({ cause }) => (cause === "none" ? "rebel" : cause);

function circlesInOrder(circles) {
  const contact = ({ kind, ttc_s }) => (kind === "rebel" ? (ttc_s ?? 1e9) : Infinity);
  return [...circles].sort((a, b) => compare(contact(a), contact(b)) || a.id - b.id);
}

export function objectsInOrder(objects) {
  const contact = (thing) => (isMet(thing) ? -1e9 : 0) + (thing.ttc_s ?? 1e8);
  return [...objects].sort((a, b) => compare(contact(a), contact(b)) || a.id - b.id);
}

function compare(a, b) {
  return a === b ? 0 : a < b ? -1 : 1;
}

// What is met first, in words, and when; of the circles where a daemon tells of no objects. Null: nothing is.
export function urgent(scene) {
  const thing = objectsInOrder(scene.objects)[0];
  if (thing) return isMet(thing) ? { ttc_s: thing.ttc_s, text: words(thingName(thing), thing) } : null;
  const circle = circlesInOrder(scene.circles)[0];
  return circle?.kind === "rebel" ? { ttc_s: circle.ttc_s, text: words(circleName(circle), circle) } : null;
}

function words(name, { ttc_s, ttc_sigma_s = null, range_m, range_sigma_m = null, bearing }) {
  const parts = [name];
  if (ttc_s !== null) parts.push(`contact in ${measured(ttc_s, ttc_sigma_s)} s`);
  if (range_m !== null) parts.push(`${measured(range_m, range_sigma_m)} m`);
  if (bearing !== null) parts.push(`${Math.abs(bearing * DEGREES).toFixed(0)}° ${bearing < 0 ? "left" : "right"}`);
  return parts.map((part) => part.replaceAll(" ", "\u00a0")).join(" · ");
}

export function showObjects(body, count, scene) {
  const objects = scene ? objectsInOrder(scene.objects) : [];
  count.textContent = scene ? `${objects.length}, ${objects.filter(isMet).length} to be met` : "";
  fill(body, objects, OBJECT_COLUMNS, (thing) => (isMet(thing) ? "met" : thing.state === "seen" ? "" : "unseen"));
}

export function showCircles(body, count, scene) {
  const circles = scene ? circlesInOrder(scene.circles) : [];
  const rebels = circles.filter(({ kind }) => kind === "rebel").length;
  count.textContent = scene ? `${rebels} rebel, ${circles.length - rebels} normal, ${scene.psi.length} ψ` : "";
  fill(body, circles, CIRCLE_COLUMNS, ({ kind }) => kind);
}

function fill(body, things, columns, kind) {
  while (body.rows.length > things.length) body.deleteRow(-1);
  things.forEach((thing, at) => {
    const row = body.rows[at] ?? body.insertRow();
    row.className = kind(thing);
    columns.forEach((column, of) => set(row.cells[of] ?? row.insertCell(), column(thing)));
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
