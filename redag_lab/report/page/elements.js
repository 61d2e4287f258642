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

/** Makes the children of a node look like fresh ones. Equal ones stay, with focus, selection and scrolling. */
function patch(node, fresh) {
  fresh.forEach((wanted, i) => {
    const old = node.children[i];
    if (old === undefined) node.append(wanted);
    else if (old.tagName === 'TR' && old.cloneNode().isEqualNode(wanted.cloneNode())) patch(old, [...wanted.children]);
    else if (!old.isEqualNode(wanted)) old.replaceWith(wanted);
  });
  while (node.children.length > fresh.length) node.lastElementChild.remove();
}

/** Returns a named row of buttons, one of which is pressed. A press on another one calls `choose(index)`. */
function choice(label, names, chosen, choose) {
  const buttons = names.map((name, i) => element('button', {type: 'button', 'aria-pressed': String(i === chosen), onclick: () => {
    buttons.forEach((button, j) => button.setAttribute('aria-pressed', String(i === j)));
    choose(i);
  }}, name));
  return element('span.switch', {role: 'group', 'aria-label': label}, ...buttons);
}

/** Returns a labelled drop-down list. */
function dropdown(label, names, chosen, choose) {
  const list = element('select', {'aria-label': label, onchange: () => choose(list.selectedIndex)},
    ...names.map((name, i) => element('option', i === chosen ? {selected: ''} : {}, name)));
  return element('label', {}, label, list);
}

/** Returns a name that may break between its parts. */
const breakable = (name) => name.split(/(?<=[._/])/).flatMap((part, i) => (i === 0 ? [part] : [element('wbr'), part]));

/** Returns a heading that the contents list, if it has an `id`. */
const heading = (level, id, text) => element(`h${level}`, {id, tabindex: '-1'}, text);

/** Returns a tooltip's lines, the first one bold. As a node, they cannot be parsed as markup by ECharts. */
function tip(lines) {
  const [first, ...rest] = lines;
  return element('div.tip', {}, element('b', {}, first), ...rest.filter(Boolean).map((line) => element('div', {}, line)));
}
