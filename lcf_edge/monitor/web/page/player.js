// The slider of a replay, and what stands beside it. What it asks for is done by lcf-edge view; what came of it is told
// with the next update.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const HELD_MS = 400; // after it was moved, the slider does not follow older news

export class Player {
  #replay = null;
  #held = -Infinity;
  #marked = "";
  #wish = null; // the newest place that is sought, while another is on its way
  #asking = false;

  constructor(box) {
    this.box = box;
    const [part, button] = [(name) => box.querySelector(`[data-part=${name}]`), (name, act) => part(name).addEventListener("click", act)];
    this.slider = part("slider");
    this.play = part("play");
    this.time = part("time");
    this.marks = part("marks");
    this.speed = part("speed");
    for (const speed of SPEEDS) this.speed.append(new Option(`× ${speed}`, speed));
    button("previous", () => ask("previous"));
    button("play", () => ask(this.#replay?.playing ? "pause" : "play"));
    button("step", () => ask("step"));
    button("next", () => ask("next"));
    this.speed.addEventListener("change", () => ask("speed", Number(this.speed.value)));
    this.slider.addEventListener("input", () => {
      this.#held = performance.now();
      this.#seek(Number(this.slider.value));
    });
  }

  take(replay) {
    this.#replay = replay;
    this.box.hidden = !replay;
    if (!replay) return;
    const { position_s, length_s, start_s, playing, speed, alarms_s, searched } = replay;
    [this.slider.min, this.slider.max] = [start_s, length_s];
    if (performance.now() - this.#held > HELD_MS) this.slider.value = position_s;
    this.slider.setAttribute("aria-valuetext", `${position_s.toFixed(2)} s`);
    const label = playing ? "Pause" : "Play";
    if (this.play.textContent !== label) this.play.textContent = label;
    const count = `${alarms_s.length} ${alarms_s.length === 1 ? "alarm" : "alarms"}${searched ? "" : " so far"}`;
    this.time.textContent = `${position_s.toFixed(2)} of ${length_s.toFixed(2)} s · ${count}`;
    if (![...this.speed.options].some((option) => Number(option.value) === speed)) this.speed.append(new Option(`× ${speed}`, speed));
    if (document.activeElement !== this.speed) this.speed.value = speed;
    this.#mark(alarms_s, start_s, length_s);
  }

  #mark(alarms_s, start_s, length_s) {
    const marked = [start_s, length_s, ...alarms_s].join();
    if (marked === this.#marked) return;
    this.#marked = marked;
    this.marks.replaceChildren(...alarms_s.map((alarm_s) => {
      const mark = document.createElement("i");
      mark.style.left = `${(100 * (alarm_s - start_s)) / Math.max(length_s - start_s, 1e-3)}%`;
      return mark;
    }));
  }

  async #seek(at_s) {
    this.#wish = at_s;
    if (this.#asking) return;
    this.#asking = true;
    while (this.#wish !== null) {
      const value = this.#wish;
      this.#wish = null;
      await ask("seek", value);
    }
    this.#asking = false;
  }
}

function ask(wish, value = 0) {
  return fetch("player", {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ do: wish, value }),
  }).catch(() => null); // that it does not answer is told elsewhere
}
