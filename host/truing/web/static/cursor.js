// The time that a page points at: plots set it, plots and floor views show it.

class Cursor {
  constructor() { this.t = null; this.live = false; this.views = new Set(); }

  // live: of the live signals; otherwise of the run that the page shows.
  set(t, live = false) {
    if (t === this.t && live === this.live) return;
    this.t = t; this.live = live;
    for (const view of this.views) view();
  }
}

export const cursor = new Cursor();
window.truingCursor = cursor;
