// The drawer: the commands that repeat what the page did, for the shell and for Python.
import { h, fill, button } from "./dom.js";

export class Drawer {
  constructor(root, app) {
    Object.assign(this, { root, app, language: "shell" });
    this.toggler = document.getElementById("commands");
  }

  toggle() {
    this.root.hidden = !this.root.hidden;
    this.toggler.setAttribute("aria-expanded", String(!this.root.hidden));
    this.update();
  }

  choose(language) { this.language = language; this.update(); }

  async copy(text, from) {
    await this.app.attempt(async () => {
      await navigator.clipboard.writeText(text);
      from.textContent = "Copied";
      setTimeout(() => { from.textContent = "Copy"; }, 1500);
    });
  }

  update() {
    if (this.root.hidden) return;
    const commands = [...this.app.state.commands].reverse();
    const entry = command => {
      const text = command[this.language], copy = button("Copy", () => this.copy(text, copy), { class: "quiet" });
      return h("li", {},
        h("div", { class: "command" }, h("pre", { tabindex: "0" }, text), copy),
        command.files.length > 0 && h("details", {}, h("summary", {}, `${command.files.length} files written`), h("ul", {}, command.files.map(file => h("li", {}, file)))));
    };
    fill(this.root,
      h("div", { class: "row" },
        h("h2", {}, "Commands"),
        ["shell", "python"].map(language => button(language === "shell" ? "Shell" : "Python", () => this.choose(language), { "aria-pressed": String(this.language === language) })),
        h("span", { class: "soft" }, "newest first; run in the folder where stylet studio was started"),
        button("Close", () => this.toggle(), { class: "quiet right" })),
      commands.length === 0
        ? h("p", { class: "soft" }, "Nothing yet. Writing results, simulating, diagnosing, planning and predicting appear here.")
        : h("ol", {}, commands.map(entry)));
  }
}
