// A target for dropped or chosen files: each is posted unchanged, and the answers are emitted.
export default {
  template: `<div class="drop-zone" :class="{ over }" @dragover.prevent="over = true" @dragleave="over = false" @drop.prevent="drop">
    <label><span>{{ text }}</span><input type="file" multiple :accept="accept" @change="chosen" :aria-label="text"></label></div>`,
  props: { text: String, accept: String, address: String },
  data: () => ({ over: false }),
  methods: {
    drop(event) { this.over = false; this.post(event.dataTransfer.files); },
    async chosen(event) { await this.post(event.target.files); event.target.value = ""; },
    async post(files) {
      const answers = [];
      for (const file of files) {
        try {
          const answer = await fetch(`${this.address}?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
          answers.push(await answer.json());
        } catch (error) { answers.push({ error: `${file.name}: ${error}` }); }
      }
      this.$emit("dropped", answers);
    },
  },
};
