// The page: asks for an update when it has drawn the last one, and shows it. A hidden page asks for nothing.

import { Picture } from "./picture.js";
import { Player } from "./player.js";
import { showCircles, showDevices, showObjects, urgent } from "./tables.js";
import { TopDown } from "./topdown.js";
import { Traces } from "./traces.js";

const RETRY_MS = 1000;
const STALE_S = 1;
const SOON_S = 4;

const find = (id) => document.getElementById(id);
const picture = new Picture(find("picture"), find("why"), find("behind"), find("key"));
const player = new Player(find("player"));
const above = new TopDown(find("above"), find("ahead"));
const traces = new Traces(find("traces"), find("tables"));
const show = { paused: false, answered: Date.now(), silent: false, gaveUpPreview: false };
let socket = null;

function connect() {
  if (show.paused || document.hidden || socket) return;
  const mine = new WebSocket(`${location.protocol === "https:" ? "wss:" : "ws:"}//${location.host}/updates`);
  socket = mine;
  mine.binaryType = "arraybuffer";
  let waiting = null; // an update, perhaps with its picture still to come
  mine.onopen = () => mine.send("next");
  mine.onmessage = async ({ data }) => {
    let image = null;
    if (typeof data === "string") {
      waiting = JSON.parse(data);
      if (waiting.picture) return;
    } else {
      image = await createImageBitmap(new Blob([data], { type: "image/jpeg" })).catch(() => null);
    }
    if (socket !== mine) return; // paused meanwhile
    take(waiting, image);
    requestAnimationFrame(() => mine.readyState === WebSocket.OPEN && mine.send("next"));
  };
  mine.onclose = () => {
    if (socket !== mine) return; // it was closed here
    socket = null;
    silent();
    setTimeout(connect, RETRY_MS);
  };
}

function disconnect() {
  const mine = socket;
  socket = null;
  mine?.close();
}

async function silent() {
  show.silent = true;
  const since = new Date(show.answered).toLocaleTimeString();
  const answer = await fetch("icon.svg").catch(() => null);
  if (socket && !show.silent) return; // it came back meanwhile
  const refused = answer?.status === 403;
  tell("state", "error", refused ? "not let in: open the address that lcf-edge view prints now" : `lcf-edge view does not answer since ${since}`);
  showNothing("no news");
}

function take(update, image) {
  show.answered = Date.now();
  show.silent = false;
  if (update.status) show.gaveUpPreview = update.status.some((one) => one.name === "memory" && one.message.includes("the preview"));
  traces.beginning(update.replay && update.scene && update.scene.stamp_ns - 1e9 * update.replay.position_s);
  if (update.points) traces.add(update.points);
  if (update.status) showDevices(find("devices"), update.status);
  picture.take(image, update.picture, update.scene, show.gaveUpPreview, update.replay && !update.replay.playing);
  player.take(update.replay);
  for (const id of ["pause", "save"]) find(id).hidden = Boolean(update.replay);
  const scene = picture.shown(update.scene);
  showState({ ...update, scene });
  showObjects(find("things"), find("thing-count"), scene);
  showCircles(find("rows"), find("count"), scene);
  above.take(scene, update.ahead);
  find("save").textContent = `Save the last ${update.history_s} s`;
}

function showState({ connection, scene, replay, diagnostics_age_s }) {
  const live = scene && scene.age_s < STALE_S;
  const names = connection.robots.join(", ");
  const since = new Date(Date.now() - 1000 * connection.for_s).toLocaleTimeString();
  const spell = `since ${since} (${span(connection.for_s)})`;
  if (connection.presence === "sought") tell("state", "warn", `waiting for a daemon at ${connection.endpoint} ${spell}`);
  else if (connection.presence === "away") tell("state", "error", `daemon away ${spell}`);
  else if (replay) tell("state", replay.playing ? "ok" : "stale", `${replay.playing ? "replay" : "replay, paused"}: ${names}`);
  else if (live) tell("state", "ok", `live: ${names}`);
  else tell("state", "warn", `${names} is there, but no scenes ${scene ? `for ${span(scene.age_s)}` : "yet"}`);
  const isOld = !replay && diagnostics_age_s > STALE_S * 3;
  find("age").textContent = isOld ? `as of ${span(diagnostics_age_s)} ago` : "";
  document.body.classList.toggle("old-health", isOld);
  if (!live) {
    showNothing("no scenes");
    return;
  }
  document.body.classList.remove("old");
  const parts = [];
  if (scene.rate_hz !== null) parts.push(`${scene.rate_hz.toFixed(1)} scenes/s`);
  if (scene.latency_ms !== null) parts.push(`latency ${scene.latency_ms.toFixed(1)} ms`);
  parts.push(scene.speed === null ? "speed unknown" : `${scene.speed.toFixed(2)} m/s`);
  if (connection.broken) parts.push(`${connection.broken} payloads refused`);
  find("figures").textContent = parts.join("  ·  ");
  const first = urgent(scene);
  tell("threat", first ? (first.ttc_s < SOON_S ? "error" : "warn") : "ok", first ? first.text : "nothing to be met");
}

function showNothing(why) {
  document.body.classList.add("old");
  find("figures").textContent = "";
  tell("threat", "stale", why);
}

function tell(id, level, text) {
  const element = find(id);
  element.dataset.level = level;
  if (element.textContent !== text) element.textContent = text;
}

function span(seconds) {
  const whole = Math.floor(seconds);
  if (whole < 60) return `${whole} s`;
  return whole < 3600 ? `${Math.floor(whole / 60)} min` : `${Math.floor(whole / 3600)} h ${Math.floor(whole / 60) % 60} min`;
}

find("pause").addEventListener("click", ({ target }) => {
  show.paused = !show.paused;
  target.setAttribute("aria-pressed", show.paused);
  target.textContent = show.paused ? "Go on" : "Pause";
  if (show.paused) {
    disconnect();
    tell("state", "stale", `paused at ${new Date().toLocaleTimeString()}`);
  } else {
    connect();
  }
});
document.addEventListener("visibilitychange", () => (document.hidden ? disconnect() : connect()));
const scheme = matchMedia("(prefers-color-scheme: dark)");
const drawAll = () => [picture, above, traces].forEach((one) => one.draw());
scheme.addEventListener("change", drawAll);
addEventListener("resize", drawAll);
find("snap").addEventListener("click", () => picture.save());

const panels = [...document.querySelectorAll("input[name=panel]")];
panels.forEach((input) => input.addEventListener("change", () => picture.choose(input.value)));
const usual = innerWidth < 1400 ? "circles" : "both";
panels.find((input) => input.value === usual).checked = true;
picture.choose(usual);
connect();
