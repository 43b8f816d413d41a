// One parameter: a slider over a bar that shows its interval, and a number field. It keeps its own value while
// it is dragged or typed, also when the page is redrawn.
export default {
  template: `<div class="slider" :style="bar">
    <span>{{ label }}</span>
    <input type="number" step="any" :value="draft ?? text" :aria-label="title + ', value'" @input="draft = $event.target.value" @change="typed">
    <input type="range" :min="low" :max="high" :step="(high - low) / 500" :value="at" :aria-label="label" @input="moved">
    <span class="dim interval">{{ intervalText }}</span></div>`,
  props: { title: String, unit: String, value: Number, low: Number, high: Number, interval: Array },
  data() { return { at: this.value, sent: 0, waiting: null, draft: null }; },
  watch: { value(now) { this.at = now; } },
  computed: {
    label() { return this.unit ? `${this.title}, ${this.unit}` : this.title; },
    digits() { return Math.max(0, Math.min(6, 3 - Math.floor(Math.log10(this.high - this.low)))); },
    text() { return String(Number(this.at.toFixed(this.digits + 1))); },
    bar() {
      if (!this.interval) return {};
      const [a, b] = this.interval.map((end) => 100 * (end - this.low) / (this.high - this.low));
      return { "--a": `${a}%`, "--b": `${Math.max(b, a + 0.8)}%` };
    },
    intervalText() {
      return this.interval ? this.interval.map((end) => end.toFixed(this.digits).replace("-", "−")).join(" to ") : "no interval";
    },
  },
  methods: {
    moved(event) { this.setValue(event.target.valueAsNumber); },
    typed(event) { this.draft = null; if (Number.isFinite(event.target.valueAsNumber)) this.setValue(event.target.valueAsNumber); },
    setValue(value) {
      this.at = value;
      if (this.waiting) return;
      const left = Math.max(0, this.sent + 50 - performance.now());
      this.waiting = setTimeout(() => { this.waiting = null; this.sent = performance.now(); this.$emit("adjust", this.at); }, left);
    },
  },
};
