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
  function standalone(svg) {
    const copied = svg.cloneNode(true);
    each(".crosshair", (line) => line.remove(), copied);
    const { width, height } = svg.viewBox.baseVal;
    copied.setAttribute("width", `${width}pt`);
    copied.setAttribute("height", `${height}pt`);
    copied.setAttribute("style", "stroke-linejoin: round; stroke-linecap: butt; background: #ffffff");
    return plain(new XMLSerializer().serializeToString(copied));
  }
  function savePng(name, svg) {
    const image = new Image();
    const { width, height } = svg.viewBox.baseVal;
    image.onload = () => {
      const canvas = make("canvas");
      [canvas.width, canvas.height] = [width * 4, height * 4];
      const context = canvas.getContext("2d");
      context.fillStyle = "#ffffff";
      context.fillRect(0, 0, canvas.width, canvas.height);
      context.drawImage(image, 0, 0, canvas.width, canvas.height);
      save(name, canvas.toDataURL("image/png"));
    };
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(standalone(svg))}`;
  }
  function figureCsv(data) {
    const rows = [["panel", "series", data.x_label, "value", "low", "high"]];
    for (const panel of data.panels)
      for (const series of [...panel.lines, ...panel.known])
        series.x.forEach((x, k) =>
          rows.push([panel.label, series.label, x, series.y[k], series.low?.[k], series.high?.[k]].map((v) => (v == null ? "" : String(v))))
        );
    return csv(rows);
  }
  const nearest = (values, x) => {
    let best = 0;
    values.forEach((v, k) => {
      if (Math.abs(v - x) < Math.abs(values[best] - x)) best = k;
    });
    return best;
  };
  const scale = (axes) => (axes.log_x ? Math.log : (v) => v);
  const shown = (v) => {
    const extreme = Math.abs(v) >= 1e5 || (v !== 0 && Math.abs(v) < 1e-3);
    return (extreme ? v.toExponential(3) : String(Number(v.toPrecision(5)))).replaceAll("-", "\u2212");
  };

  each("figure", (figure) => {
    const data = JSON.parse(figure.querySelector("script").textContent);
    const drawing = figure.querySelector(".drawing");
    const readout = figure.querySelector(".readout");
    const hint = readout.textContent;
    const wide = drawing.querySelector(".wide svg");
    const visible = () => (drawing.querySelector(".wide").offsetWidth ? "wide" : "narrow");
    const grid = [...new Set(data.panels.flatMap((p) => p.lines.flatMap((l) => l.x)))].sort((a, b) => a - b);
    let at = -1;

    function show(x) {
      if (!grid.length) return;
      at = nearest(grid, x);
      const kind = visible();
      const svg = drawing.querySelector(`.${kind} svg`);
      const { width, height } = svg.viewBox.baseVal;
      const axes = data.axes[kind];
      each(".crosshair", (line) => line.remove(), drawing);
      const line = document.createElementNS("http://www.w3.org/2000/svg", "line");
      const [x0, x1, here] = [axes[0].x0, axes[0].x1, grid[at]].map(scale(axes[0]));
      const place = axes[0].left + ((axes[0].right - axes[0].left) * (here - x0)) / (x1 - x0);
      const ends = { x1: place * width, x2: place * width, y1: axes[0].top * height, y2: axes[axes.length - 1].bottom * height };
      for (const [key, v] of Object.entries(ends)) line.setAttribute(key, v);
      line.setAttribute("class", "crosshair");
      svg.append(line);
      readout.replaceChildren(make("span", `${data.x_label}: ${shown(grid[at])}`));
      for (const panel of data.panels)
        for (const series of panel.lines) {
          const k = series.x.indexOf(grid[at]);
          if (k < 0 || series.y[k] === null) continue;
          const item = make("span");
          const swatch = make("span", undefined, "swatch");
          swatch.style.color = `var(--ink-${series.colour.slice(1)}, ${series.colour})`;
          item.append(swatch, `${series.label} `, make("b", shown(series.y[k])));
          if (data.panels.length > 1) item.append(` (${panel.label})`);
          readout.append(item);
        }
    }
    function hide() {
      each(".crosshair", (line) => line.remove(), drawing);
      readout.textContent = hint;
      at = -1;
    }
    drawing.addEventListener("pointermove", (event) => {
      const kind = visible();
      const box = drawing.querySelector(`.${kind} svg`).getBoundingClientRect();
      const a = data.axes[kind][0];
      const share = ((event.clientX - box.left) / box.width - a.left) / (a.right - a.left);
      if (share < -0.02 || share > 1.02) return;
      const [x0, x1] = [a.x0, a.x1].map(scale(a));
      const x = x0 + share * (x1 - x0);
      show(a.log_x ? Math.exp(x) : x);
    });
    drawing.addEventListener("pointerleave", hide);
    drawing.addEventListener("blur", hide);
    drawing.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!step) return;
      event.preventDefault();
      show(grid[Math.max(0, Math.min(grid.length - 1, at < 0 ? 0 : at + step))]);
    });
    figure.querySelector("[data-save=csv]").addEventListener("click", () => saveText(`${data.name}.csv`, "text/csv", figureCsv(data)));
    figure.querySelector("[data-save=svg]").addEventListener("click", () => saveText(`${data.name}.svg`, "image/svg+xml", standalone(wide)));
    figure.querySelector("[data-save=png]").addEventListener("click", () => savePng(`${data.name}.png`, wide));
  });
})();
