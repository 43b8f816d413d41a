// The last seconds of both wheels: commanded against measured speed above, effort below.
import { live } from "/view-static/live.js";

const SECONDS = 12;
const LEFT = "#ffb454", RIGHT = "#5ccfe6";

export default {
  template: `<canvas tabindex="-1" role="img" aria-label="Wheel speeds, commands and efforts over the last twelve seconds"></canvas>`,
  mounted() {
    this.draw = () => this.paint();
    live.views.add(this.draw);
    this.observer = new ResizeObserver(() => this.paint());
    this.observer.observe(this.$el);
  },
  unmounted() { live.views.delete(this.draw); this.observer.disconnect(); },
  methods: {
    paint() {
      const canvas = this.$el, scale = window.devicePixelRatio || 1;
      const width = canvas.clientWidth, height = canvas.clientHeight;
      if (!width || !height) return;
      if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
        canvas.width = Math.round(width * scale); canvas.height = Math.round(height * scale);
      }
      const c = canvas.getContext("2d");
      c.setTransform(scale, 0, 0, scale, 0, 0);
      c.clearRect(0, 0, width, height);
      const samples = live.samples, end = samples.length ? samples[samples.length - 1][0] : 0;
      let first = samples.length;
      while (first > 0 && samples[first - 1][0] > end - SECONDS && samples[first - 1][0] <= end) first -= 1;
      const shown = samples.slice(first);
      let top = 0.2;
      for (const s of shown) top = Math.max(top, Math.abs(s[1]), Math.abs(s[2]), Math.abs(s[3] || 0), Math.abs(s[4] || 0));
      top = niceTop(top);
      const upper = Math.round(height * 0.62);
      // Room for the labels of both axes where one panel ends and the other begins, and above the seconds.
      const h0 = upper - 8, y1 = upper + 6, h1 = height - y1 - 22;
      this.panel(c, 0, h0, width, top, "m/s", end);
      this.panel(c, y1, h1, width, 1, "effort", end);
      const line = (index, colour, y0, h, full, dash, thick) => {
        c.beginPath(); c.strokeStyle = colour; c.lineWidth = thick; c.setLineDash(dash);
        let drawing = false;
        for (const s of shown) {
          if (s[index] === null) { drawing = false; continue; }
          const x = 34 + (width - 40) * (1 - (end - s[0]) / SECONDS), y = y0 + h / 2 - s[index] / full * (h / 2 - 3);
          if (drawing) c.lineTo(x, y); else c.moveTo(x, y);
          drawing = true;
        }
        c.stroke(); c.setLineDash([]);
      };
      line(3, LEFT, 0, h0, top, [4, 3], 1); line(4, RIGHT, 0, h0, top, [4, 3], 1);
      line(1, LEFT, 0, h0, top, [], 1.8); line(2, RIGHT, 0, h0, top, [], 1.8);
      line(5, LEFT, y1, h1, 1, [], 1.5); line(6, RIGHT, y1, h1, 1, [], 1.5);
      c.fillStyle = "#94a1b2"; c.font = "11px system-ui"; c.textAlign = "center";
      for (let s = 0; s <= SECONDS; s += 3) c.fillText(s ? `−${s} s` : "now", 34 + (width - 40) * (1 - s / SECONDS) - (s ? 0 : 8), height - 3);
    },
    panel(c, y, h, width, full, unit) {
      c.strokeStyle = "#232b36"; c.lineWidth = 1;
      c.fillStyle = "#94a1b2"; c.font = "11px system-ui"; c.textAlign = "right";
      for (const share of [-1, 0, 1]) {
        const at = Math.round(y + h / 2 - share * (h / 2 - 3)) + 0.5;
        c.beginPath(); c.moveTo(34, at); c.lineTo(width - 6, at); c.stroke();
        c.fillText((share * full).toFixed(full < 1 ? 1 : 1).replace("-", "−"), 30, at + 4);
      }
      c.textAlign = "left"; c.fillText(unit, 38, y + 12);
    },
  },
};

function niceTop(value) {
  for (const top of [0.2, 0.4, 0.6, 0.8, 1, 1.5, 2, 3, 5, 10]) if (value <= top) return top;
  return Math.ceil(value);
}
