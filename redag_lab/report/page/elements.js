// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Builds the page's elements. Names come from users and are only ever set as text, never as markup.

/** Creates an element: element('td.bad', {title: 'x'}, 'text', child, ...). */
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

/**
 * Returns a table in a frame that scrolls sideways. A row is an array of strings, nodes, or {text, kind}; its first
 * cell is the row's head.
 */
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

/** Returns a row of buttons, one of which is pressed. A press on another one calls `choose(index)`. */
function choice(names, chosen, choose) {
  const buttons = names.map((name, i) => element('button', {type: 'button', 'aria-pressed': String(i === chosen), onclick: () => {
    buttons.forEach((button, j) => button.setAttribute('aria-pressed', String(i === j)));
    choose(i);
  }}, name));
  return element('span.switch', {role: 'group'}, ...buttons);
}

/** Returns a labelled drop-down list. */
function dropdown(label, names, chosen, choose) {
  const list = element('select', {'aria-label': label, onchange: () => choose(list.selectedIndex)},
    ...names.map((name, i) => element('option', i === chosen ? {selected: ''} : {}, name)));
  return element('label', {}, label, list);
}

/** Returns a tooltip's lines, the first one bold. As a node, they cannot be parsed as markup by ECharts. */
function tip(lines) {
  const [first, ...rest] = lines;
  return element('div.tip', {}, element('b', {}, first), ...rest.filter(Boolean).map((line) => element('div', {}, line)));
}
