// What a page shows, in its address: reload, back, and a link to somebody else lead to the same picture.
// The last address of every page is kept for the tab; set and run are common to all pages that show runs.

const COMMON = ["set", "run"];

class Address {
  constructor() { this.waiting = {}; }

  // The view's process writes for a page whose address the tab may not have yet.
  writeAt(page, values, step, tries = 40) {
    if (this.page() === page) this.write(values, step);
    else if (tries) setTimeout(() => this.writeAt(page, values, step, tries - 1), 25);
  }

  page() {
    const prefix = window.path_prefix || "";
    return location.pathname.startsWith(prefix) ? location.pathname.slice(prefix.length) || "/" : location.pathname;
  }

  // Values of "" are left out. `push`: a step that Back undoes.
  write(values, push = false) {
    const query = new URLSearchParams(location.search);
    for (const [name, value] of Object.entries(values)) if (value === "") query.delete(name); else query.set(name, value);
    const search = readable(query), page = this.page() + (search ? `?${search}` : "");
    if (search !== location.search.slice(1)) history[push ? "pushState" : "replaceState"]({ page }, "", (window.path_prefix || "") + page);
    this.remember();
  }

  later(values) { // zoom and pan change many times a second
    Object.assign(this.waiting, values);
    this.path = this.page();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      const path = this.path, pending = this.waiting;
      this.waiting = {};
      if (path === this.page()) this.write(pending);
    }, 250);
  }

  remember() {
    sessionStorage.setItem(`truing:${this.page()}`, location.search);
    const query = new URLSearchParams(location.search);
    for (const name of COMMON) if (query.has(name)) sessionStorage.setItem(`truing:common:${name}`, query.get(name));
    this.links();
  }

  forgetRun() { // a new run has come: pages open with it
    for (const name of COMMON) sessionStorage.removeItem(`truing:common:${name}`);
    for (const link of document.querySelectorAll("a[data-shows-runs]")) sessionStorage.removeItem(`truing:${link.dataset.page}`);
    this.links();
  }

  links() { // the bar leads to each page as it was left
    for (const link of document.querySelectorAll("a[data-page]")) {
      const query = new URLSearchParams(sessionStorage.getItem(`truing:${link.dataset.page}`) ?? "");
      if (link.hasAttribute("data-shows-runs")) {
        const moved = COMMON.some((name) => (sessionStorage.getItem(`truing:common:${name}`) ?? "") !== (query.get(name) ?? ""));
        if (moved) for (const name of ["t", "v", "span"]) query.delete(name);
        for (const name of COMMON) {
          const value = sessionStorage.getItem(`truing:common:${name}`);
          if (value) query.set(name, value); else query.delete(name);
        }
      }
      const search = readable(query);
      link.setAttribute("href", link.dataset.page + (search ? `?${search}` : ""));
    }
  }
}

function readable(query) { return query.toString().replaceAll("%2F", "/").replaceAll("%2C", ",").replaceAll("%3A", ":").replaceAll("%7E", "~"); }

export const address = new Address();
document.addEventListener("click", (event) => { if (event.target.closest?.("a[data-page]")) address.links(); }, true);
window.truingAddress = address;
