// A number that is typed: what has been typed so far stays when the page is redrawn meanwhile.
export default {
  template: `<input type="number" step="any" :value="draft ?? value" :aria-label="label"
    @input="draft = $event.target.value" @change="finish">`,
  props: { label: String, value: String },
  data: () => ({ draft: null }),
  methods: {
    finish(event) { const text = event.target.value; this.draft = null; this.$emit("typed", text); },
  },
};
