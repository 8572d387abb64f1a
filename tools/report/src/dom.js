// SPDX-License-Identifier: BSD-3-Clause
// Elements. All text goes in as text, never as HTML: names of sequences and folders are anybody's.

export function el(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name === 'style') Object.assign(node.style, value);
    else if (name === 'dataset') Object.assign(node.dataset, value);
    else if (name.startsWith('aria') || name === 'role' || name === 'for') node.setAttribute(name, value);
    else node[name] = value;
  }
  node.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return node;
}

export function section(id, title, ...children) {
  return el('section', { id }, el('h2', {}, title), ...children);
}

export function swatch(colour) {
  return el('span', { className: 'swatch', style: { background: colour } });
}

// A row of boxes to tick: entries {key, label, colour, on}; calls change(key, on).
export function layers(entries, change) {
  return el('div', { className: 'layers' }, entries.map((entry) => {
    const box = el('input', { type: 'checkbox', checked: entry.on !== false, dataset: { key: entry.key } });
    box.addEventListener('change', () => change(entry.key, box.checked));
    return el('label', {}, box, entry.colour ? swatch(entry.colour) : null, entry.label);
  }));
}

// A table of rows of cells; the first row of `head` is its header. A cell is a text, an element or {text, best, title}.
export function table(caption, head, rows) {
  const cell = (content) => {
    if (content === null || content === undefined) return el('td', { className: 'soft' }, '–');
    if (content instanceof Node || typeof content !== 'object') return el('td', {}, content);
    return el('td', { className: content.best ? 'best' : '', title: content.title ?? '' }, content.text);
  };
  return el('div', { className: 'scroll' }, el('table', {},
    caption ? el('caption', {}, caption) : null,
    el('thead', {}, el('tr', {}, head.map((name) => el('th', { scope: 'col' }, name)))),
    el('tbody', {}, rows.map((row) => el('tr', {}, row.map(cell))))));
}

// A canvas with as many pixels as the screen gives it; draw(context, width, height) in CSS pixels.
export function flatCanvas(label, height, draw) {
  const canvas = el('canvas', { className: 'flat', role: 'img', 'aria-label': label, style: { height: `${height}px` } });
  const redraw = () => {
    const scale = window.devicePixelRatio || 1, width = canvas.clientWidth;
    if (width === 0) return;
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
    const context = canvas.getContext('2d');
    context.scale(scale, scale);
    draw(context, width, height);
  };
  new ResizeObserver(redraw).observe(canvas);
  return { canvas, redraw };
}
