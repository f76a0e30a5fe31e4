// The page: shows the images that lcf-edge has, what is drawn on them, and the lines of the configuration that it makes.

import { area, OPEN, Outlines } from "./outlines.js";
import { Surface } from "./surface.js";

const ASK_MS = 400;
const find = (id) => document.getElementById(id);
const outlines = new Outlines(show);
const surface = new Surface(find("area"), find("image"), find("drawing"), outlines);
const known = { number: 0, given: null, proposed: false, checked: "", checking: false, usable: false, isSaving: false, isOver: false };

async function follow() {
  if (known.isOver) return;
  try {
    if (!known.isSaving) await take(await (await asked("state")).json());
  } catch {
    if (!known.isOver) end("error", "lcf-edge has ended: what is drawn here is not saved");
  }
  setTimeout(follow, ASK_MS);
}

async function asked(path) {
  const answer = await fetch(path);
  if (!answer.ok) throw new Error(answer.statusText);
  return answer;
}

async function take({ number, live, measuring, note, given, proposed }) {
  if (number !== known.number && !document.hidden && !known.isSaving) {
    surface.show(await createImageBitmap(await (await asked("image")).blob()));
    known.number = number;
  }
  if (!known.given) {
    known.given = given;
    outlines.closed = structuredClone(given);
    show();
  }
  if (!measuring && !known.proposed) {
    known.proposed = true;
    outlines.propose(proposed);
  }
  const how = live ? "drive past things, with turns to both sides; what never moves" : "what never moves in the recording";
  write("note", measuring ? `Being made: ${how} is proposed here.` : note);
  if (!known.isOver) tell("ok", live ? "live" : measuring ? "reading the recording" : "recording");
}

function show() {
  surface.draw();
  const { closed, open, proposed, chosen, current } = outlines;
  find("undo").disabled = known.isOver || !outlines.canUndo;
  find("close").disabled = !outlines.canClose;
  find("remove").disabled = chosen?.corner == null;
  find("hint").textContent = hint(open.length, current);
  find("outlines").replaceChildren(...closed.map((corners, at) => row(corners, `Outline ${at + 1}`, at === current, {
    Change: () => outlines.choose(at),
    Delete: () => outlines.remove(at),
  })));
  find("none").hidden = closed.length > 0;
  find("proposed").replaceChildren(...proposed.map((corners, at) => row(corners, `Proposal ${at + 1}`, false, {
    Keep: () => outlines.keep(corners),
    Drop: () => outlines.drop(corners),
  })));
  find("all").hidden = proposed.length < 2;
  check();
}

function hint(open, current) {
  if (open >= 3) return "Set more corners; the first one, or Close outline, closes it.";
  if (open) return "Set at least three corners around the part.";
  if (current !== null) return "Drag a corner to move it, a small circle between two to add one. Click beside it to begin another outline.";
  return "Click or tap to set the corners of an outline around what you see of the vehicle; beside the image counts as its border.";
}

function row(corners, name, isChosen, actions) {
  const { width, height } = find("image");
  const item = document.createElement("li");
  const text = document.createElement("span");
  text.textContent = `${name}: ${corners.length} corners, ${(100 * area(corners) / (width * height)).toFixed(1)} %`;
  item.append(text);
  item.toggleAttribute("data-chosen", isChosen);
  for (const [label, act] of Object.entries(actions)) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = label;
    button.setAttribute("aria-label", `${label} ${name}`);
    button.addEventListener("click", act);
    item.append(button);
  }
  return item;
}

// Ask for the lines of what is drawn now; while an answer is on its way, only the newest drawing waits.
async function check() {
  const drawing = JSON.stringify({ polygons: outlines.closed });
  if (drawing === known.checked || known.checking || !known.given || known.isOver) {
    allowSaving(drawing === known.checked);
    return;
  }
  allowSaving(false);
  known.checking = true;
  const answer = await send("check", drawing);
  known.checking = false;
  known.checked = drawing;
  if (answer) {
    known.usable = answer.ok;
    find("lines").textContent = await answer.text();
    find("lines").classList.toggle("refused", !answer.ok);
  }
  check();
}

function allowSaving(isChecked) {
  const why = known.isOver ? "" : unfinished();
  write("why", why);
  find("save").disabled = known.isOver || !isChecked || !known.usable || why !== "";
}

// What is to be done before it can be saved; a mask that there was can be made empty.
function unfinished() {
  if (outlines.open.length) return "close the outline, then save";
  if (outlines.proposed.length) return "keep or drop the proposal, then save";
  return outlines.closed.length || known.given.length ? "" : "nothing is drawn yet";
}

async function save() {
  known.isSaving = true;
  const answer = await send("save", JSON.stringify({ polygons: outlines.closed }));
  known.isSaving = false;
  if (answer?.ok) end("ok", "saved: lcf-edge has it, see the terminal");
  else if (answer) find("lines").textContent = await answer.text();
}

function send(path, body) {
  return fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body }).catch(() => null);
}

function end(level, text) {
  known.isOver = true;
  for (const id of ["see", "outlines", "proposal"]) find(id).inert = true; // the lines can still be copied
  tell(level, text);
  show();
}

function tell(level, text) {
  find("state").dataset.level = level;
  write("state", text);
}

function write(id, text) {
  if (find(id).textContent !== text) find(id).textContent = text;
}

const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

addEventListener("keydown", (event) => {
  const { chosen } = outlines;
  if ((event.ctrlKey || event.metaKey) && event.key === "z") outlines.undo();
  else if (event.key === "Enter" && event.target === document.body) outlines.close();
  else if (event.key === "Delete" || event.key === "Backspace") outlines.removeCorner();
  else if (event.key === "Escape") outlines.choose(outlines.open.length ? OPEN : null);
  else if (event.key in STEPS && chosen?.corner != null) nudge(chosen, STEPS[event.key], event.shiftKey ? 10 : 1);
  else return;
  event.preventDefault();
});

function nudge(corner, [right, down], px) {
  const { width, height } = find("image");
  const [x, y] = outlines.corners(corner.outline)[corner.corner];
  const inside = (value, size) => Math.min(Math.max(value, 0), size - 1);
  outlines.remember();
  outlines.move(corner, [inside(x + px * right, width), inside(y + px * down, height)]);
}

find("undo").addEventListener("click", () => outlines.undo());
find("close").addEventListener("click", () => outlines.close());
find("remove").addEventListener("click", () => outlines.removeCorner());
find("keep").addEventListener("click", () => outlines.keep(...outlines.proposed));
find("drop").addEventListener("click", () => outlines.drop(...outlines.proposed));
find("save").addEventListener("click", save);
follow();
