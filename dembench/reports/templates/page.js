"use strict";
(() => {
  const each = (selector, act, root = document) => root.querySelectorAll(selector).forEach(act);
  const make = (tag, text, className) => {
    const element = document.createElement(tag);
    if (text !== undefined) element.textContent = text;
    if (className) element.className = className;
    return element;
  };

  function save(name, url) {
    const link = make("a");
    link.href = url;
    link.download = name;
    document.body.append(link);
    link.click();
    link.remove();
  }
  const saveText = (name, type, text) => save(name, `data:${type};charset=utf-8,${encodeURIComponent(text)}`);
  const csv = (rows) =>
    rows.map((row) => row.map((v) => (/[",\n\r]/.test(v) ? `"${v.replaceAll('"', '""')}"` : v)).join(",")).join("\r\n") + "\r\n";

  // ---- tables
  const value = (cell) => cell.dataset.value ?? cell.textContent.trim().replace(/\s+/g, " ");
  function order(a, b) {
    const numeric = [a, b].map((text) => (text === "" ? NaN : Number(text)));
    if (numeric.every(Number.isFinite)) return numeric[0] - numeric[1];
    return a.localeCompare(b, undefined, { numeric: true });
  }
  each("table", (table) => {
    const headers = [...table.tHead.rows[0].cells];
    headers.forEach((header, column) =>
      header.querySelector("button").addEventListener("click", () => {
        const down = header.getAttribute("aria-sort") === "ascending";
        headers.forEach((other) => other.removeAttribute("aria-sort"));
        header.setAttribute("aria-sort", down ? "descending" : "ascending");
        const rows = [...table.tBodies[0].rows].sort((a, b) => {
          const [x, y] = [value(a.cells[column]), value(b.cells[column])];
          if (x === "" || y === "") return (x === "") - (y === ""); // what has no value stays last
          return down ? order(y, x) : order(x, y);
        });
        table.tBodies[0].append(...rows);
      })
    );
    table.closest(".table").querySelector("[data-save=csv]").addEventListener("click", () => {
      const title = (header) => header.dataset.title;
      const body = [...table.tBodies[0].rows].map((row) => [...row.cells].map(value));
      saveText(`${table.id}.csv`, "text/csv", csv([headers.map(title), ...body]));
    });
  });

  // ---- copying commands
  async function copy(text) {
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const area = make("textarea", text);
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
  }
  each(".copy", (button) =>
    button.addEventListener("click", async () => {
      await copy(button.parentElement.querySelector("pre").textContent);
      button.textContent = "copied";
      setTimeout(() => (button.textContent = "copy"), 1500);
    })
  );

  // ---- figures
  const plain = (text) => text.replace(/var\(--[\w-]+,\s*(#[0-9a-f]{6})\)/g, "$1");
  const serialized = (svg) => plain(new XMLSerializer().serializeToString(svg));
  const sizeOf = (svg) => [svg.viewBox.baseVal.width, svg.viewBox.baseVal.height];
  function standalone(svg) {
    const copied = svg.cloneNode(true);
    each(".crosshair", (line) => line.remove(), copied);
    const [width, height] = sizeOf(svg);
    copied.setAttribute("width", `${width}pt`);
    copied.setAttribute("height", `${height}pt`);
    copied.setAttribute("style", "stroke-linejoin: round; stroke-linecap: butt; background: #ffffff");
    return copied;
  }
  function savePng(name, svg) {
    const image = new Image();
    const [width, height] = sizeOf(svg);
    image.onload = () => {
      const canvas = make("canvas");
      [canvas.width, canvas.height] = [width * 4, height * 4];
      const context = canvas.getContext("2d");
      context.fillStyle = "#ffffff";
      context.fillRect(0, 0, canvas.width, canvas.height);
      context.drawImage(image, 0, 0, canvas.width, canvas.height);
      save(name, canvas.toDataURL("image/png"));
    };
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(serialized(standalone(svg)))}`;
  }
  function figureCsv(data) {
    const rows = [["panel", "series", data.shared ? data.x_label : "horizontal", "value", "low", "high"]];
    for (const panel of data.panels)
      for (const series of [...panel.lines, ...panel.known])
        series.x.forEach((x, k) =>
          rows.push([panel.x_label ? `${panel.label} over ${panel.x_label}` : panel.label, series.label, x, series.y[k], series.low?.[k], series.high?.[k]].map((v) => (v == null ? "" : String(v))))
        );
    return csv(rows);
  }
  const scale = (axes) => (axes.log_x ? Math.log : (v) => v);
  const shown = (v) => {
    const extreme = Math.abs(v) >= 1e5 || (v !== 0 && Math.abs(v) < 1e-3);
    return (extreme ? v.toExponential(3) : String(Number(v.toPrecision(5)))).replaceAll("-", "\u2212");
  };

  const SVG = "http://www.w3.org/2000/svg";
  each("figure.plot", (figure) => {
    const data = JSON.parse(figure.querySelector("script").textContent);
    const drawing = figure.querySelector(".drawing");
    const readout = figure.querySelector(".readout");
    const hint = readout.textContent;
    const wide = drawing.querySelector(".wide svg");
    const visible = () => (drawing.querySelector(".wide").offsetWidth ? "wide" : "narrow");
    const all = data.panels.map((_, k) => k);
    // A stop is what is read at once: a place on the axis that panels share, or on that of one panel, or one point.
    const stops = (data.shared ? [all] : all.map((k) => [k])).flatMap((panels) => {
      const lines = panels.flatMap((k) => data.panels[k].lines);
      if (data.panels[panels[0]].equal) return lines.flatMap((line) => line.x.map((x, k) => ({ panels, x, y: line.y[k], line })));
      return [...new Set(lines.flatMap((line) => line.x))].sort((a, b) => a - b).map((x) => ({ panels, x }));
    });
    let at = -1;

    function crosshair(svg, place) {
      const line = document.createElementNS(SVG, "line");
      for (const [key, v] of Object.entries(place)) line.setAttribute(key, v);
      line.setAttribute("class", "crosshair");
      svg.append(line);
    }
    function share(axes, key, v) {
      const [low, high, here] = [axes[`${key}0`], axes[`${key}1`], v].map(key === "x" ? scale(axes) : (w) => w);
      return (here - low) / (high - low);
    }
    function show(index) {
      at = index;
      const stop = stops[at];
      if (!stop) return;
      const kind = visible();
      const svg = drawing.querySelector(`.${kind} svg`);
      const { width, height } = svg.viewBox.baseVal;
      each(".crosshair", (line) => line.remove(), drawing);
      for (const k of stop.panels) {
        const axes = data.axes[kind][k];
        const x = width * (axes.left + (axes.right - axes.left) * share(axes, "x", stop.x));
        crosshair(svg, { x1: x, x2: x, y1: axes.top * height, y2: axes.bottom * height });
        if (stop.line) {
          const y = height * (axes.bottom - (axes.bottom - axes.top) * share(axes, "y", stop.y));
          crosshair(svg, { x1: axes.left * width, x2: axes.right * width, y1: y, y2: y });
        }
      }
      const label = data.panels[stop.panels[0]].x_label || data.x_label;
      readout.replaceChildren(make("span", `${label}: ${shown(stop.x)}`));
      for (const panel of stop.panels.map((k) => data.panels[k]))
        for (const series of stop.line ? [stop.line] : panel.lines) {
          const value = stop.line ? stop.y : series.y[series.x.indexOf(stop.x)];
          if (value == null) continue;
          const item = make("span");
          const swatch = make("span", undefined, "swatch");
          swatch.style.color = `var(--ink-${series.colour.slice(1)}, ${series.colour})`;
          item.append(swatch, `${series.label} `, make("b", shown(value)));
          if (data.panels.length > 1) item.append(` (${panel.label})`);
          readout.append(item);
        }
    }
    function hide() {
      each(".crosshair", (line) => line.remove(), drawing);
      readout.textContent = hint;
      at = -1;
    }
    function nearest(axes, panel, right, down) {
      const height = (axes.bottom - axes.top) / (axes.right - axes.left);
      let best = -1;
      let least = Infinity;
      stops.forEach((stop, k) => {
        if (!stop.panels.includes(panel)) return;
        const aside = stop.line ? height * (share(axes, "y", stop.y) - (axes.bottom - down) / (axes.bottom - axes.top)) : 0;
        const far = Math.hypot(share(axes, "x", stop.x) - (right - axes.left) / (axes.right - axes.left), aside);
        if (far < least) [best, least] = [k, far];
      });
      return best;
    }
    drawing.addEventListener("pointermove", (event) => {
      const kind = visible();
      const box = drawing.querySelector(`.${kind} svg`).getBoundingClientRect();
      const [right, down] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
      const inside = (a) => right > a.left - 0.02 && right < a.right + 0.02;
      const panel = data.axes[kind].findIndex((a) => inside(a) && (data.shared || (down > a.top && down < a.bottom)));
      if (panel >= 0) show(nearest(data.axes[kind][panel], panel, right, down));
    });
    drawing.addEventListener("pointerleave", hide);
    drawing.addEventListener("blur", hide);
    drawing.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!step) return;
      event.preventDefault();
      show(Math.max(0, Math.min(stops.length - 1, at < 0 ? 0 : at + step)));
    });
    figure.querySelector("[data-save=csv]").addEventListener("click", () => saveText(`${data.name}.csv`, "text/csv", figureCsv(data)));
    figure.querySelector("[data-save=svg]").addEventListener("click", () => saveText(`${data.name}.svg`, "image/svg+xml", serialized(standalone(wide))));
    figure.querySelector("[data-save=png]").addEventListener("click", () => savePng(`${data.name}.png`, wide));
  });

  // ---- pictures: one drawing of the legend and all shots, row by row
  function together(figure) {
    const [edge, gap] = [8, 16];
    const sheet = document.createElementNS(SVG, "svg");
    let [right, down] = [0, edge];
    const put = (svg, x) => {
      const [width, height] = sizeOf(svg);
      const copied = svg.cloneNode(true);
      for (const [key, v] of Object.entries({ x, y: down, width, height })) copied.setAttribute(key, v);
      sheet.append(copied);
      right = Math.max(right, x + width);
      return [width, height];
    };
    down += put(figure.querySelector(".legend svg"), edge)[1] + gap;
    each(".shots", (row) => {
      const shots = [...row.querySelectorAll("svg")];
      const columns = Math.min(5, Number(figure.dataset.columns));
      for (let first = 0; first < shots.length; first += columns) {
        let x = edge;
        let tallest = 0;
        for (const svg of shots.slice(first, first + columns)) {
          const [width, height] = put(svg, x);
          [x, tallest] = [x + width + gap, Math.max(tallest, height)];
        }
        down += tallest + gap;
      }
    }, figure);
    sheet.setAttribute("viewBox", `0 0 ${right + edge} ${down}`);
    return sheet;
  }
  each("figure.album", (figure) => {
    figure.querySelector("[data-save=svg]").addEventListener("click", () =>
      saveText(`${figure.id}.svg`, "image/svg+xml", serialized(standalone(together(figure)))));
    figure.querySelector("[data-save=png]").addEventListener("click", () => savePng(`${figure.id}.png`, together(figure)));
  });
})();
