// Runs a worker's script in a hidden frame where the page was opened as a file: browsers start no worker there,
// and the search of the site needs one.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      this.ready = new Promise((resolve) => frame.addEventListener("load", resolve, { once: true }));
      const script = new URL(url, document.baseURI).href.replace(/"/g, "&quot;");
      frame.srcdoc =
        "<script>window.postMessage = (data) => parent.postMessage({ worker: data }, '*');" +
        "window.onerror = (text) => console.error('search: ' + text)</" +
        `script><script src="${script}"></` +
        "script>";
      window.addEventListener("message", (event) => {
        if (event.source === frame.contentWindow) {
          this.dispatchEvent(new MessageEvent("message", { data: event.data.worker }));
        }
      });
      document.documentElement.append(frame);
      this.frame = frame;
    }

    postMessage(data) {
      // The frame's own postMessage answers this page; an event is what its script listens for.
      this.ready.then(() => {
        const inside = this.frame.contentWindow;
        inside.dispatchEvent(new inside.MessageEvent("message", { data }));
      });
    }
  };
}
