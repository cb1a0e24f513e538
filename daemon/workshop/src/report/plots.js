// Values at the pointer and zoom. This only adds: without it the page is complete.
"use strict";
(() => {
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
  const shown = (value, digits) => (value === null ? "–" : value.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace("-", "−"));

  // Numbers come as whole steps from one to the next, decimals first.
  const decode = ([digits, ...steps]) => {
    let sum = 0;
    return { digits, values: steps.map((step) => (step === null ? null : (sum += step) / 10 ** digits)) };
  };
  const chartOf = ({ x, points, at, series }) => ({
    x, points,
    at: at && decode(at),
    series: series.map(([name, unit, values, halves]) => ({
      name, unit, values: decode(values), halves: halves && decode(halves),
    })),
  });

  // Where x lies among the data: an index and the share of the way to the next one.
  const placeAmong = ({ at: { values }, points }, x) => {
    if (points) {
      const away = values.map((value) => Math.abs(value - x));
      return [away.indexOf(Math.min(...away)), 0];
    }
    const next = values.findIndex((value, k) => k > 0 && value !== null && values[k - 1] !== null
      && values[k - 1] <= x && x <= value);
    if (next < 0) return null;
    const span = values[next] - values[next - 1];
    return [next - 1, span > 0 ? (x - values[next - 1]) / span : 0];
  };
  const valueAt = ({ values }, place) => {
    if (!place) return null;
    const [k, share] = place;
    return share > 0 ? values[k] + share * (values[k + 1] - values[k]) : values[k];
  };
  const lineOf = ({ name, unit, values, halves }, place) => {
    const half = halves && place ? ` ± ${shown(valueAt(halves, place), halves.digits)}` : "";
    return `${name}: ${shown(valueAt(values, place), values.digits)}${half}${unit && ` ${unit}`}`;
  };
  // Points beside a line are shown with where they are.
  const linesOf = (chart, x, leading) => {
    const place = placeAmong(chart, x);
    const where = chart.points && !leading.points
      ? ` (at ${shown(chart.at.values[place[0]], chart.at.digits)} ${chart.x[1]})` : "";
    return chart.series.map((series) => lineOf(series, place) + where);
  };

  // Round values that mark a range at about so many places.
  const ticks = ([from, to], count) => {
    const decade = 10 ** Math.floor(Math.log10((to - from) / count));
    const step = [1, 2, 5, 10].map((it) => it * decade).find((it) => (to - from) / it <= count);
    const first = Math.ceil(from / step);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    return Array.from({ length: Math.floor(to / step) - first + 1 }, (_, k) => [(first + k) * step, digits]);
  };

  // What of a drawing's elements lies along its horizontal axis.
  const across = { rect: ["x"], circle: ["cx"], text: ["x"], line: ["x1", "x2"] };
  const moved = (element, original, map) => {
    if (original.points) {
      const points = original.points.map(([x, y]) => `${map(x).toFixed(1)},${y}`);
      element.setAttribute("points", points.join(" "));
    }
    (across[element.tagName] || []).forEach((name, k) => element.setAttribute(name, map(original.x[k])));
    if (original.width) element.setAttribute("width", map(original.x[0] + original.width) - map(original.x[0]));
  };
  const originalOf = (element) => ({
    points: element.hasAttribute("points")
      && element.getAttribute("points").trim().split(" ").map((point) => point.split(",").map(Number)),
    x: (across[element.tagName] || []).map((name) => Number(element.getAttribute(name))),
    width: element.tagName === "rect" && Number(element.getAttribute("width")),
  });

  let clips = 0;
  const answer = (svg, charts, box, button) => {
    const frames = JSON.parse(svg.dataset.frames);
    const [left, , right, , , from, to] = frames[0];
    const make = (name, attributes, parent = svg) => {
      const element = parent.appendChild(document.createElementNS(svg.namespaceURI, name));
      Object.entries(attributes).forEach(([key, value]) => element.setAttribute(key, value));
      return element;
    };
    const leading = charts.find((chart) => chart.at);
    if (!leading) return;
    let range = [from, to];
    let at = null;
    let drag = null;
    let parts = null;
    const pxOf = (x) => left + ((x - range[0]) / (range[1] - range[0])) * (right - left);
    const xOf = (event) => {
      const area = svg.getBoundingClientRect();
      const px = ((event.clientX - area.left) / area.width) * svg.viewBox.baseVal.width;
      return range[0] + ((clamp(px, left, right) - left) / (right - left)) * (range[1] - range[0]);
    };

    // The elements within the charts, and those of the labels below; found when first needed.
    const sortOut = () => {
      parts = frames.map(([l, t, r, b, labelsEnd]) => {
        const clip = make("clipPath", { id: `clip-${(clips += 1)}` });
        make("rect", { x: l, y: t - 4, width: r - l, height: b - t + 8 }, clip);
        const part = { inside: [], labels: [], clip: `url(#${clip.id})`, b };
        for (const element of svg.querySelectorAll(":scope > :not(clipPath, .ours)")) {
          const bounds = element.getBBox();
          const [x, y] = [bounds.x + bounds.width / 2, bounds.y + bounds.height / 2];
          if (x >= l - 12 && y > b && y <= labelsEnd) part.labels.push(element);
          else if (x > l + 1 && x <= r && y >= t && y <= b) part.inside.push([element, originalOf(element)]);
        }
        return part;
      });
    };
    const zoom = (wanted) => {
      if (!parts) sortOut();
      const width = Math.max(wanted[1] - wanted[0], (to - from) / 1000);
      const start = clamp(wanted[0], from, to - Math.min(width, to - from));
      range = [start, Math.min(start + width, to)];
      const isWhole = range[0] <= from && range[1] >= to;
      svg.querySelectorAll(".tick").forEach((element) => element.remove());
      for (const { inside, labels, clip, b } of parts) {
        for (const [element, original] of inside) {
          moved(element, original, (px) => pxOf(from + ((px - left) / (right - left)) * (to - from)));
          if (isWhole) element.removeAttribute("clip-path");
          else element.setAttribute("clip-path", clip);
        }
        labels.forEach((element) => { element.style.display = isWhole ? "" : "none"; });
        const text = labels.find((element) => element.tagName === "text");
        if (isWhole || !text) continue;
        const count = 1.3 * labels.filter((element) => element.tagName === "text").length;
        for (const [value, digits] of ticks(range, count)) {
          const label = svg.appendChild(text.cloneNode());
          label.style.display = "";
          label.setAttribute("class", "ours tick");
          label.setAttribute("x", pxOf(value));
          label.textContent = shown(value, digits);
          make("line", { class: "ours tick", x1: pxOf(value), x2: pxOf(value), y1: b, y2: b + 6,
            stroke: "var(--axis)", "stroke-width": 2 });
        }
      }
      svg.dataset.shown = JSON.stringify(range);
      button.hidden = isWhole;
      button.onclick = () => zoom([from, to]);
      if (at !== null) read(clamp(at, ...range));
    };

    const hide = () => {
      at = null;
      box.hidden = true;
      svg.querySelectorAll(".pointer, .stretch").forEach((element) => element.remove());
    };
    const read = (x) => {
      hide();
      const place = leading.points ? placeAmong(leading, x) : null;
      at = place ? leading.at.values[place[0]] : x;
      if (at < range[0] || at > range[1]) at = x;
      const [name, unit] = leading.x;
      const rows = charts.filter((chart) => chart.at).flatMap((chart) => linesOf(chart, at, leading));
      box.textContent = [`${name} ${shown(at, leading.at.digits)} ${unit}`, ...rows].join("\n");
      box.hidden = false;
      const px = pxOf(at);
      for (const [, t, , b] of frames) make("line", { class: "ours pointer", x1: px, x2: px, y1: t, y2: b });
      if (drag !== null) {
        const [start, end] = [pxOf(drag), px].sort((one, other) => one - other);
        for (const [, t, , b] of frames) {
          make("rect", { class: "ours stretch", x: start, y: t, width: end - start, height: b - t });
        }
      }
      const area = svg.getBoundingClientRect();
      const home = svg.closest("figure").getBoundingClientRect();
      const beside = (px / svg.viewBox.baseVal.width) * area.width + area.left - home.left;
      const isRight = beside + 12 + box.offsetWidth > home.width;
      box.style.left = `${isRight ? Math.max(0, beside - 12 - box.offsetWidth) : beside + 12}px`;
      box.style.top = `${area.top - home.top + 28}px`;
    };

    svg.classList.add("answers");
    svg.tabIndex = 0;
    svg.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      if (event.pointerType === "mouse") svg.setPointerCapture(event.pointerId);
      drag = xOf(event);
      read(drag);
    });
    svg.addEventListener("pointermove", (event) => read(xOf(event)));
    svg.addEventListener("pointerup", (event) => {
      const ends = [drag, xOf(event)].sort((one, other) => one - other);
      const isDrag = drag !== null && pxOf(ends[1]) - pxOf(ends[0]) > 16;
      drag = null;
      if (isDrag) zoom(ends);
    });
    svg.addEventListener("pointercancel", () => { drag = null; hide(); });
    svg.addEventListener("pointerleave", (event) => { if (event.pointerType === "mouse") hide(); });
    svg.addEventListener("blur", hide);
    svg.addEventListener("dblclick", () => zoom([from, to]));
    svg.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey) return;
      const [low, high] = range;
      const x = at ?? (low + high) / 2;
      const scaled = (factor) => zoom([x + (low - x) * factor, x + (high - x) * factor]);
      const step = (sign) => {
        const further = leading.at.values.filter((value) => leading.points && sign * (value - x) > 0);
        const wanted = further.length ? Math.min(...further.map((value) => sign * (value - x))) : (high - low) / 100;
        read(clamp(x + sign * wanted, low, high));
      };
      const keys = {
        ArrowLeft: () => step(-1), ArrowRight: () => step(1),
        "+": () => scaled(0.5), "-": () => scaled(2),
        Escape: () => { hide(); zoom([from, to]); },
      };
      if (!keys[event.key]) return;
      event.preventDefault();
      keys[event.key]();
    });
  };

  const figures = document.querySelectorAll("figure[data-readings]");
  for (const figure of figures) {
    const charts = JSON.parse(figure.dataset.readings).map(chartOf);
    const add = (name, of) => Object.assign(figure.appendChild(document.createElement(name)), { hidden: true, ...of });
    const box = add("output", { className: "reading" });
    const button = add("button", { className: "whole", type: "button", textContent: "Whole range" });
    figure.querySelectorAll("svg.plot").forEach((svg) => answer(svg, charts, box, button));
  }
  if (figures.length > 0) {
    const hint = document.createElement("p");
    hint.className = "note hint";
    hint.textContent = "Plots show their values at the pointer. Drag across one to zoom, double click to see the "
      + "whole again; with the keyboard: arrows, + and −, Escape.";
    figures[0].closest("section").querySelector("h2").after(hint);
  }
})();
