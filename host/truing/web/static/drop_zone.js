// A target for dropped or chosen files: each is posted unchanged, one after the other, and the answers are emitted.
export default {
  template: `<div class="drop-zone" :class="{ over }" @dragover.prevent="over = true" @dragleave="over = false" @drop.prevent="drop">
    <label><span>{{ text }}</span><input type="file" multiple :accept="accept" @change="chosen" :aria-label="text"></label>
    <p v-if="doing" class="note" role="status">{{ doing }} <button type="button" class="plain" @click="cancel">Cancel</button></p></div>`,
  props: { text: String, accept: String, address: String, limit: Number },
  data: () => ({ over: false, doing: "" }),
  unmounted() { this.cancel(); },
  methods: {
    drop(event) { this.over = false; this.post([...event.dataTransfer.files]); },
    async chosen(event) { const files = [...event.target.files]; event.target.value = ""; await this.post(files); },
    cancel() { this.cancelled = true; this.request?.abort(); },
    // Recordings first: the first one names the set that the others, its baseline and its metadata belong to.
    async post(files, wishes = {}) {
      const rank = (file) => /(\.toml|\.meta\.json)$/.test(file.name) ? 1 : 0;
      const answers = [];
      this.cancelled = false;
      this.asked = [];
      let home = wishes.set || "";
      for (const file of [...files].sort((a, b) => rank(a) - rank(b))) {
        if (this.cancelled) break;
        // Refused before anything is sent: the view would refuse it too, after the browser has begun.
        if (file.size > this.limit) answers.push({ error: `${file.name}: ${megabytes(file.size)}; a page takes files of up to ${megabytes(this.limit)}. "truing import FILE" reads larger ones.` });
        else {
          const answer = await this.send(file, { ...wishes, set: home });
          home = home || (answer.kind !== "diagnosis" && answer.set) || "";
          if (answer.ask) this.asked.push(file);
          // One question at a time: its answer holds for the files that wait as well.
          if (!answer.ask || this.asked.length === 1) answers.push(answer);
        }
      }
      this.home = home;
      this.doing = "";
      this.$emit("dropped", answers);
    },
    again(wishes) { this.post(this.asked, { ...wishes, set: this.home }); },
    send(file, wishes) {
      return new Promise((done) => {
        const request = this.request = new XMLHttpRequest();
        request.open("POST", `${this.address}?${new URLSearchParams({ name: file.name, ...wishes })}`);
        request.responseType = "json";
        this.doing = `${file.name}: uploading`;
        request.upload.onprogress = (event) => { this.doing = `${file.name}: ${Math.floor(100 * event.loaded / Math.max(1, event.total))} % uploaded`; };
        request.upload.onload = () => { this.doing = `${file.name}: reading it …`; };
        request.onload = () => done(request.response ?? { error: `${file.name}: the view answered with status ${request.status}.` });
        request.onerror = () => done({ error: `${file.name}: the upload broke off. Try again.` });
        request.onabort = () => done({ error: `${file.name}: cancelled.` });
        request.send(file);
      });
    },
  },
};

function megabytes(bytes) { return `${(bytes / 1e6).toFixed(0)} MB`; }
