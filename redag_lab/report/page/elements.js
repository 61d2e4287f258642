// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Building the page. Names come from users: they are only ever set as text, never as markup.

/** element('td.bad', {title: 'x'}, 'text', child, ...). */
function element(kind, attributes = {}, ...children) {
  const [tag, ...classes] = kind.split('.');
  const node = document.createElement(tag);
  if (classes.length > 0) node.className = classes.join(' ');
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith('on')) node.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined) node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

const SVG = 'http://www.w3.org/2000/svg';
function svgElement(tag, attributes, ...children) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

/** A table in a frame that scrolls sideways. Rows: arrays of strings, nodes, or {text, kind}; the first is the head. */
function table(columns, rows) {
  const cell = (content, tag, column) => {
    const plain = content === null || typeof content !== 'object' || content instanceof Node;
    const {text, kind = '', title} = plain ? {text: content} : content;
    const classes = [tag, kind, columns[column].text ? 'text' : ''].filter((part) => part !== '').join('.');
    return element(classes, {title, scope: tag === 'th' ? 'row' : null}, text);
  };
  const head = element('tr', {}, ...columns.map((column) => element(column.text ? 'th.text' : 'th',
    {scope: 'col', title: column.help}, column.title)));
  const body = rows.map((row) => element(row.first ? 'tr.group' : 'tr', {},
    ...row.cells.map((content, i) => cell(content, i === 0 ? 'th' : 'td', i))));
  return element('div.table', {tabindex: '0'}, element('table', {}, element('thead', {}, head), element('tbody', {}, ...body)));
}

/** Buttons of which one is pressed. `choose(index)` is called when another one is. */
function choice(names, chosen, choose) {
  const buttons = names.map((name, i) => element('button', {type: 'button', 'aria-pressed': String(i === chosen), onclick: () => {
    buttons.forEach((button, j) => button.setAttribute('aria-pressed', String(i === j)));
    choose(i);
  }}, name));
  return element('span.switch', {role: 'group'}, ...buttons);
}

/** A labelled list to choose from. */
function dropdown(label, names, chosen, choose) {
  const list = element('select', {'aria-label': label, onchange: () => choose(list.selectedIndex)},
    ...names.map((name, i) => element('option', i === chosen ? {selected: ''} : {}, name)));
  return element('label', {}, label, list);
}

/** Lines of text for a tooltip: the first one strong. Returned as a node, so that ECharts does not read it as markup. */
function tip(lines) {
  const [first, ...rest] = lines;
  return element('div.tip', {}, element('b', {}, first), ...rest.filter(Boolean).map((line) => element('div', {}, line)));
}
