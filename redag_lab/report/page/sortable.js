// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tables that a reader can sort, by click or key. Long ones show their first rows until the reader asks for all; paper
// shows more. On a phone a row becomes a card (page.css). The roles are explicit, because cards are no table to browsers.

const MOST_ROWS_AT_ONCE = 40;
const MOST_ROWS_PRINTED = 400;
const orders = new Map();  // caption -> what the reader chose, kept when the table is made again

const column = (title, help, text = false) => ({title, help, text});

// A cell's content is a string, a node, or {text, kind, title, sort}.
const isPlain = (content) => content === null || content === undefined || typeof content !== 'object' || content instanceof Node;
const contentOf = (content) => (isPlain(content) ? {text: content} : content);
function sortKey(content) {
  const {text, sort} = contentOf(content);
  if (sort !== undefined) return sort;
  return text instanceof Node ? text.textContent : text;
}

// Rows without a value come last, in either direction.
function inOrder(rows, {at, down}) {
  if (at === null) return rows;
  const isMissing = (key) => key === null || key === undefined || key === '';
  const before = (a, b) => (typeof a === 'number' && typeof b === 'number' ? a - b : String(a).localeCompare(String(b), 'en', {numeric: true}));
  return [...rows].sort((x, y) => {
    const [a, b] = [sortKey(x.cells[at]), sortKey(y.cells[at])];
    if (isMissing(a) || isMissing(b)) return Number(isMissing(a)) - Number(isMissing(b));
    return down ? before(b, a) : before(a, b);
  });
}

function rowOf(columns, row, isSorted) {
  const cells = row.cells.map((content, i) => {
    const {text, kind = '', title} = contentOf(content);
    const tag = i === 0 ? 'th' : 'td';
    const classes = [tag, kind, columns[i].text ? 'text' : ''].filter((part) => part !== '').join('.');
    return element(classes, {
      title, 'data-label': columns[i].title, role: i === 0 ? 'rowheader' : 'cell', scope: i === 0 ? 'row' : null,
    }, text);
  });
  const first = row.first && !isSorted;
  return element(first ? 'tr.group' : 'tr', {role: 'row', 'aria-current': row.current ? 'true' : null}, ...cells);
}

/**
 * Returns a table. `caption` names it, and is the only one of this name on the page. A row is {cells, first, current};
 * its first cell is the row's head. `total` counts all rows, if not all are here.
 */
function table(caption, columns, rows, {sortable = true, most = MOST_ROWS_AT_ONCE, total = rows.length} = {}) {
  if (!orders.has(caption)) orders.set(caption, {at: null, down: false, all: false});
  const order = orders.get(caption);
  const body = element('tbody', {role: 'rowgroup'});
  const more = element('div');
  const heads = columns.map(({title, help, text}, i) => element(text ? 'th.text' : 'th', {scope: 'col', role: 'columnheader', title: sortable ? null : help},
    sortable && title !== '' ? element('button.sort', {type: 'button', title: help, onclick: () => sortBy(i)}, title) : title));
  const choices = element('div.row.cards-only.controls', {}, dropdown('sort by', ['as listed', ...columns.map(({title}) => title)], order.at === null ? 0 : order.at + 1,
    (i) => sortBy(i === 0 ? null : i - 1)));

  function sortBy(at) {
    // Numbers begin with the largest one, names with the first.
    const isNumber = at !== null && rows.some(({cells}) => typeof sortKey(cells[at]) === 'number');
    order.down = order.at === at ? !order.down : isNumber;
    order.at = at;
    refill();
  }
  function refill() {
    heads.forEach((head, i) => {
      if (!sortable) return;
      head.setAttribute('aria-sort', order.at !== i ? 'none' : order.down ? 'descending' : 'ascending');
    });
    const limit = isPrinting() ? MOST_ROWS_PRINTED : order.all ? Infinity : most;
    const shown = inOrder(rows, order).slice(0, limit);
    body.replaceChildren(...shown.map((row) => rowOf(columns, row, order.at !== null)));
    const left = total - shown.length;
    more.replaceChildren(...(left === 0 ? [] : [element('p.row.soft', {}, `${formatCount(shown.length)} rows; ${formatCount(left)} more.`,
      shown.length === rows.length ? null : element('button.controls', {type: 'button', onclick: () => {
        order.all = true;
        refill();
        frame.focus();
      }},
        `show ${rows.length === total ? 'all' : 'the worst'} ${formatCount(rows.length)}`))]));
  }
  const frame = element('div.table', {tabindex: '0', role: 'region', 'aria-label': caption}, element('table', {role: 'table', 'aria-label': caption},
    element('thead', {role: 'rowgroup'}, element('tr', {role: 'row'}, ...heads)), body));
  const box = element('div', {'data-table': caption}, sortable && rows.length > 1 ? choices : null, frame, more);
  box.refill = refill;
  refill();
  return box;
}

/** Makes the rows of all tables again: more fit on paper. */
const refillTables = () => document.querySelectorAll('[data-table]').forEach((box) => box.refill());
