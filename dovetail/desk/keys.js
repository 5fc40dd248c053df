// Keys of the whole page. The browser's own actions of these keys (save the page, undo typing) are left out, but
// a field that is typed into keeps its own undo.
export default {
  template: "<span hidden></span>",
  mounted() {
    this.pressed = (event) => {
      if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
      const typing = event.target.matches?.("input:not([type=range]):not([type=checkbox]), textarea");
      const redo = event.shiftKey ? "redo" : "undo";
      const action = { s: "save", z: typing ? "" : redo, y: typing ? "" : "redo" }[event.key.toLowerCase()];
      if (!action) return;
      event.preventDefault();
      if (!event.repeat) this.$emit("act", action);
    };
    document.addEventListener("keydown", this.pressed);
  },
  unmounted() {
    document.removeEventListener("keydown", this.pressed);
  },
};
