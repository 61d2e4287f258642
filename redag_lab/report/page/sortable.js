// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tables that a reader can sort, by click or key. Long ones show their first rows until the reader asks for all.

const MOST_ROWS_AT_ONCE = 40;
const orders = new Map();  // caption -> what the reader chose, kept when the table is made again

/** `kind`: "text" is on the left, "minor" is not shown on a narrow live page. */
const column = (title, help, kind = '') => ({title, help, kind});

// A cell's content is a string, a node, or {text, kind, title, sort}.
const contentOf = (content) => (content === null || typeof content !== 'object' || content instanceof Node ? {text: content} : content);
function sortKey(content) {
  const {text, sort} = contentOf(content);
  return sort !== undefined ? sort : text instanceof Node ? text.textContent : text;
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
    return element([tag, kind, columns[i].kind].filter(Boolean).join('.'), {
      title, scope: i === 0 ? 'row' : null,
    }, text);
  });
  return element(row.first && !isSorted ? 'tr.group' : 'tr', {'aria-current': row.current ? 'true' : null}, ...cells);
}

/**
 * Returns a table. `caption` names it, and is the only one of this name on the page. A row is {cells, first, current};
 * its first cell is the row's head. `total` counts all rows, if not all are here. update(rows) replaces them.
 */
function table(caption, columns, rows, {most = MOST_ROWS_AT_ONCE, total = 0} = {}) {
  if (!orders.has(caption)) orders.set(caption, {at: null, down: false, clicks: 0, all: false});
  const order = orders.get(caption);
  const body = element('tbody');
  const more = element('div');
  const heads = columns.map(({title, help, kind}, i) => element(['th', kind].filter(Boolean).join('.'), {scope: 'col'},
    element('button.sort', {type: 'button', title: help, onclick: () => sortBy(i)}, title)));
  const frame = element('div.table', {tabindex: '0', role: 'region', 'aria-label': caption}, element('table', {'aria-label': caption},
    element('thead', {}, element('tr', {}, ...heads)), body));
  const box = element('div', {'data-table': caption}, frame, more);

  // Numbers begin with the largest one, names with the first. The third click gives the order as listed.
  function sortBy(at) {
    const isNumber = rows.some(({cells}) => typeof sortKey(cells[at]) === 'number');
    order.clicks = order.at === at ? order.clicks + 1 : 0;
    order.at = order.clicks === 2 ? null : at;
    order.down = isNumber === (order.clicks === 0);
    refill();
  }
  function refill() {
    heads.forEach((head, i) => head.setAttribute('aria-sort', order.at !== i ? 'none' : order.down ? 'descending' : 'ascending'));
    const shown = inOrder(rows, order).slice(0, order.all ? Infinity : most);
    patch(body, shown.map((row) => rowOf(columns, row, order.at !== null)));
    const left = Math.max(total, rows.length) - shown.length;
    more.replaceChildren(...(left === 0 ? [] : [element('p.row.soft', {}, `${formatCount(shown.length)} rows; ${formatCount(left)} more.`,
      shown.length === rows.length ? null : element('button.controls', {type: 'button', onclick: () => {
        order.all = true;
        refill();
        frame.focus();
      }}, `show ${total > rows.length ? 'the worst' : 'all'} ${formatCount(rows.length)}`))]));
  }
  box.update = (fresh) => {
    rows = fresh;
    refill();
  };
  refill();
  return box;
}
