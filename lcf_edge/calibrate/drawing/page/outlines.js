// What is drawn: closed outlines, the open one whose corners are being set, and what is proposed. A corner is [x, y] in
// px of the image, pixel centres at whole numbers; each change can be undone.

export const OPEN = -1; // in place of a closed outline's number

export class Outlines {
  closed = [];
  open = [];
  proposed = [];
  chosen = null; // { outline, corner }: what is being changed; corner may be null
  #past = [];

  constructor(changed) {
    this.changed = changed;
  }

  get canUndo() {
    return this.#past.length > 0;
  }

  get canClose() {
    return this.open.length >= 3;
  }

  // The outline that is open, else the one that was chosen.
  get current() {
    if (this.open.length) return OPEN;
    return this.chosen?.outline ?? null;
  }

  corners(outline) {
    return outline === OPEN ? this.open : this.closed[outline];
  }

  remember() {
    const { closed, open, proposed, chosen } = this;
    this.#past.push(structuredClone({ closed, open, proposed, chosen }));
  }

  undo() {
    if (this.canUndo) Object.assign(this, this.#past.pop());
    this.changed();
  }

  // Forget what was remembered last: nothing has come of it.
  forget() {
    this.#past.pop();
  }

  add(corner) {
    this.#change(() => {
      this.open.push(corner);
      this.chosen = { outline: OPEN, corner: this.open.length - 1 };
    });
  }

  close() {
    if (!this.canClose) return;
    this.#change(() => {
      this.closed.push(this.open);
      this.open = [];
      this.chosen = { outline: this.closed.length - 1, corner: null };
    });
  }

  // Part of a drag, which is remembered once.
  move({ outline, corner }, to) {
    this.corners(outline)[corner] = to;
    this.changed();
  }

  insert({ outline, corner }, at) {
    this.#change(() => {
      this.corners(outline).splice(corner, 0, at);
      this.chosen = { outline, corner };
    });
  }

  choose(outline, corner = null) {
    this.chosen = outline === null ? null : { outline, corner };
    this.changed();
  }

  // The corner that was chosen; what is left of two corners is no outline.
  removeCorner() {
    if (this.chosen?.corner == null) return;
    const { outline, corner } = this.chosen;
    this.#change(() => {
      const corners = this.corners(outline);
      corners.splice(corner, 1);
      this.chosen = outline === OPEN && corners.length ? { outline, corner: corners.length - 1 } : null;
      if (outline !== OPEN && corners.length < 3) this.closed.splice(outline, 1);
      else if (outline !== OPEN) this.chosen = { outline, corner: null };
    });
  }

  remove(outline) {
    this.#change(() => {
      this.closed.splice(outline, 1);
      this.chosen = null;
    });
  }

  propose(polygons) {
    this.proposed = structuredClone(polygons);
    this.changed();
  }

  keep(...proposals) {
    this.#change(() => {
      this.closed.push(...proposals);
      this.proposed = this.proposed.filter((one) => !proposals.includes(one));
    });
  }

  drop(...proposals) {
    this.#change(() => {
      this.proposed = this.proposed.filter((one) => !proposals.includes(one));
    });
  }

  #change(act) {
    this.remember();
    act();
    this.changed();
  }
}

export function area(corners) {
  let twice = 0;
  corners.forEach(([x, y], at) => {
    const [nextX, nextY] = corners[(at + 1) % corners.length];
    twice += x * nextY - nextX * y;
  });
  return Math.abs(twice) / 2;
}

// Even-odd, as it is filled.
export function isInside([x, y], corners) {
  let inside = false;
  corners.forEach(([x1, y1], at) => {
    const [x2, y2] = corners.at(at - 1);
    if (y1 > y !== y2 > y && x < x1 + ((y - y1) / (y2 - y1)) * (x2 - x1)) inside = !inside;
  });
  return inside;
}

export function middle([x1, y1], [x2, y2]) {
  return [(x1 + x2) / 2, (y1 + y2) / 2];
}
