// The page: views, state, keys. Every number comes from the studio; the page only shows it.
import { call, upload } from "./api.js";
import { h, fill, button } from "./dom.js";
import { redrawAll } from "./chart.js";
import { OpenView } from "./open.js";
import { LookView } from "./look.js";
import { PhantomView } from "./phantom.js";
import { ExplainView } from "./explain.js";
import { Drawer } from "./drawer.js";

const by = id => document.getElementById(id);

export const app = {
  state: null, library: null, view: null, file: null, views: {},

  // Runs work and shows its error instead of failing silently.
  async attempt(work) {
    try {
      return await work();
    } catch (error) {
      this.alert(error.message);
      return undefined;
    }
  },

  // `report`: a result page that the message is about.
  alert(message, level = "bad", report = null) {
    const box = h("div", { class: `alert ${level}` }, h("span", {}, message),
      report && h("a", { href: `file/${report}`, target: "_blank", rel: "noopener" }, "Open the report"), button("Close", () => box.remove(), { class: "quiet" }));
    by("alerts").append(box);
    if (by("alerts").childElementCount > 3) by("alerts").firstChild.remove();
    if (level === "good") setTimeout(() => box.remove(), report ? 15000 : 6000);
  },

  async refresh(state) {
    this.adopt(state || await call("state"));
    await this.views[this.view]?.update();
  },

  // Shows a state outside the view.
  adopt(state) {
    this.state = state;
    if (!this.state.files.includes(this.file)) this.file = this.state.files[0] || null;
    by("folder").textContent = `workspace ${this.state.folder}`;
    by("undo").disabled = !this.state.undo;
    by("redo").disabled = !this.state.redo;
    drawer.update();
  },

  // Changes the view, with a new state if one is given.
  async show(name, state = null) {
    if (state) this.adopt(state);
    this.view = name;
    for (const tab of document.querySelectorAll("[role=tab]")) {
      const chosen = tab.dataset.view === name;
      tab.setAttribute("aria-selected", String(chosen));
      tab.tabIndex = chosen ? 0 : -1;
      by(`view-${tab.dataset.view}`).hidden = !chosen;
    }
    location.hash = name;
    await this.attempt(() => this.views[name].update());
  },

  select(file) { this.file = file; return this.attempt(() => this.views[this.view].update()); },

  // Stores files and goes on to what needs attention: the columns when something is wrong, else the curves.
  async addFiles(files) {
    let last = null, phantom = null;
    for (const file of files) {
      if (file.name.endsWith(".ron")) {
        phantom = await this.attempt(async () => call("edit", { edit: { kind: "ron", text: await file.text() } }));
        continue;
      }
      const found = await this.attempt(() => upload(file));
      if (found) { last = found; this.views.open.remember(found); }
    }
    if (phantom && !last) await this.show("phantom", await call("state"));
    if (!last) return;
    this.file = last.file;
    const state = await call("state");
    await this.show(last.readable && !last.findings.some(f => f.level === "bad") ? "look" : "open", state);
  },
};

const drawer = new Drawer(by("drawer"), app);

function theme(next) {
  document.documentElement.dataset.theme = next;
  by("theme").textContent = { auto: "Theme: auto", light: "Theme: light", dark: "Theme: dark" }[next];
  try { localStorage.setItem("theme", next); } catch { /* the browser keeps nothing: the theme lasts as long as the page */ }
  redrawAll();
}

function bindKeys() {
  document.addEventListener("keydown", event => {
    const typing = event.target.matches("input:not([type=range]):not([type=checkbox]), textarea, select");
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z" && !typing) {
      event.preventDefault();
      step(event.shiftKey ? "redo" : "undo");
    } else if (!typing && !event.ctrlKey && !event.metaKey && !event.altKey) {
      const view = { 1: "open", 2: "look", 3: "phantom", 4: "explain" }[event.key];
      if (view) app.show(view);
      else if (event.key === "o") by("chooser").click();
      else if (event.key === "c") drawer.toggle();
      else if (event.key === "?") by("keys").showModal();
    }
  });
  const tabs = [...document.querySelectorAll("[role=tab]")];
  for (const [k, tab] of tabs.entries()) {
    tab.addEventListener("click", () => app.show(tab.dataset.view));
    tab.addEventListener("keydown", event => {
      const next = { ArrowRight: k + 1, ArrowLeft: k - 1, Home: 0, End: tabs.length - 1 }[event.key];
      if (next === undefined) return;
      event.preventDefault();
      const to = tabs[(next + tabs.length) % tabs.length];
      to.focus();
      app.show(to.dataset.view);
    });
  }
}

function step(name) { return app.attempt(async () => app.refresh(await call(name))); }

function bindDrop() {
  let depth = 0;
  const shown = on => { by("dropping").hidden = !on; };
  const carriesFiles = event => [...event.dataTransfer.types].includes("Files");
  addEventListener("dragenter", event => { if (carriesFiles(event)) { depth++; shown(true); } });
  addEventListener("dragleave", event => { if (carriesFiles(event) && --depth <= 0) shown(false); });
  addEventListener("dragover", event => event.preventDefault());
  addEventListener("drop", event => { event.preventDefault(); depth = 0; shown(false); app.addFiles([...event.dataTransfer.files]); });
  by("chooser").addEventListener("change", () => { app.addFiles([...by("chooser").files]); by("chooser").value = ""; });
}

async function start() {
  const asking = Promise.all([call("library"), call("state")]);
  app.views = {
    open: new OpenView(by("view-open"), app), look: new LookView(by("view-look"), app),
    phantom: new PhantomView(by("view-phantom"), app), explain: new ExplainView(by("view-explain"), app),
  };
  bindKeys();
  bindDrop();
  by("undo").addEventListener("click", () => step("undo"));
  by("redo").addEventListener("click", () => step("redo"));
  by("commands").addEventListener("click", () => drawer.toggle());
  by("help").addEventListener("click", () => by("keys").showModal());
  by("theme").addEventListener("click", () => {
    const all = ["auto", "light", "dark"];
    theme(all[(all.indexOf(document.documentElement.dataset.theme) + 1) % all.length]);
  });
  let kept = null;
  try { kept = localStorage.getItem("theme"); } catch { /* as above */ }
  theme(["auto", "light", "dark"].includes(kept) ? kept : "auto");
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redrawAll);
  const [library, state] = await asking, asked = location.hash.slice(1);
  app.library = library;
  await app.show(app.views[asked] ? asked : state.diagnosis ? "explain" : state.files.length ? "look" : "phantom", state);
  document.documentElement.dataset.ready = "true";
}

app.attempt(start);
