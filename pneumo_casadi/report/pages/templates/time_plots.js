/* Time plots: Bokeh draws, this wires the controls of the page to it. The still figure stays where
   anything fails, without JavaScript, and on paper. */
(function () {
  "use strict";
  Bokeh.logger.set_level("off"); // set_log_level writes a message itself
  const dark = matchMedia("(prefers-color-scheme: dark)");

  function paint(panels) {
    const ink = dark.matches ? "#e6e6e6" : "#1a1a1a";
    for (const panel of panels) {
      for (const grid of panel.center) grid.grid_line_color = dark.matches ? "#2b3238" : "#e8e8e8";
      for (const axis of [...panel.below, ...panel.left]) {
        axis.axis_label_text_color = ink;
        axis.major_label_text_color = ink;
        axis.axis_line_color = ink;
        axis.major_tick_line_color = ink;
        axis.minor_tick_line_color = null;
      }
    }
  }

  function wire(box, panels) {
    const range = panels[0].x_range;
    const [first, last] = range.bounds;
    const show = (start, end) => {
      const width = Math.min(end - start, last - first);
      const from = Math.min(Math.max(start, first), last - width);
      range.setv({ start: from, end: from + width });
    };
    const part = (share) => {
      const middle = (range.start + range.end) / 2;
      const half = ((range.end - range.start) * share) / 2;
      show(middle - half, middle + half);
    };
    const move = (share) => {
      const shift = (range.end - range.start) * share;
      show(range.start + shift, range.end + shift);
    };
    const detail = JSON.parse(box.dataset.detail);
    const actions = {
      in: () => part(0.5),
      out: () => part(2),
      left: () => move(-0.5),
      right: () => move(0.5),
      all: () => show(first, last),
      detail: () => show(detail[0], detail[1]),
    };
    for (const button of box.querySelectorAll("button")) {
      button.addEventListener("click", actions[button.dataset.action]);
    }
    for (const input of box.querySelectorAll("input")) {
      input.addEventListener("change", () => {
        for (const panel of panels) {
          for (const renderer of panel.renderers) {
            if (renderer.name === input.value) renderer.visible = input.checked;
          }
        }
      });
    }
    box.timeRange = range;
    box.panels = panels;
  }

  for (const box of document.querySelectorAll(".plot")) {
    const item = JSON.parse(box.querySelector("script").textContent);
    const canvas = box.querySelector(".canvas");
    box.classList.add("live");
    Bokeh.embed
      .embed_item(item, canvas)
      .then((views) => {
        const [view] = [...views];
        const panels = view.model.children;
        paint(panels);
        dark.addEventListener("change", () => paint(panels));
        wire(box, panels);
        box.dataset.ready = "yes";
      })
      .catch(() => box.classList.remove("live"));
  }
})();
