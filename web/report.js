// The report's page: fills the sections from the view and draws them. Every word goes in as text, never as HTML.
'use strict';
(() => {
  const view = JSON.parse(document.getElementById('view').textContent);
  const charts = Object.fromEntries(JSON.parse(document.getElementById('charts').textContent).map((c) => [c.name, c]));
  const P = axiscalPlots;
  const { digits, valued } = P;
  /** A unit as people write it. */
  const unitOf = (unit) => unit.replace(/^u(?=m|rad)/, 'µ').replace('deg', '°');
  const id = (name) => document.getElementById(name);

  /** An element: tag.class, properties, children (texts or elements). */
  function make(what, attributes = {}, ...children) {
    const [tag, ...classes] = what.split('.');
    const el = document.createElement(tag);
    if (classes.length) el.className = classes.join(' ');
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith('on')) el.addEventListener(name.slice(2), value);
      else if (value !== null && value !== undefined && value !== false) el.setAttribute(name, value === true ? '' : value);
    }
    el.append(...children.filter((c) => c !== null && c !== undefined));
    return el;
  }

  function section(name, title, says, into = id('more')) {
    const s = make('section', { 'aria-labelledby': `${name}-title` }, make('h2', { id: `${name}-title` }, title));
    if (says) s.append(make('p.keep', {}, says));
    into.append(s);
    return s;
  }
  /** Sections beside each other, where there is room. */
  function pair() {
    const p = make('div.pair');
    id('more').append(p);
    return p;
  }

  // plots are drawn when they come near, so that the first screen stands at once; the printer gets them all
  const redraw = [];
  const waiting = new Map();
  const watcher = new IntersectionObserver((entries) => {
    for (const e of entries) if (e.isIntersecting) drawNow(e.target);
  }, { rootMargin: '400px' });
  function drawNow(el) {
    const job = waiting.get(el);
    if (!job) return;
    waiting.delete(el);
    watcher.unobserve(el);
    job();
  }
  function plot(el, job, now = false) {
    redraw.push(() => { if (!waiting.has(el)) job(); });
    if (now) { job(); return; }
    waiting.set(el, job);
    watcher.observe(el);
  }
  const figure = (name, caption, tall = false) => {
    const div = make(tall ? 'div.plot.tall' : 'div.plot', { id: name });
    return [make('figure', {}, div, caption ? make('figcaption', {}, caption) : null), div];
  };

  const e = view.errors;
  const state = { from: e.before, to: e.after, directions: new Set([0, 1, 2]), rung: e.before, flat: false };

  // ---------------------------------------------------------------- theme
  const dark = () => document.documentElement.dataset.theme === 'dark'
    || (!document.documentElement.dataset.theme && matchMedia('(prefers-color-scheme: dark)').matches);
  const button = id('theme');
  const named = () => { button.textContent = dark() ? 'light' : 'dark'; button.setAttribute('aria-label', `change to ${dark() ? 'light' : 'dark'} colours`); };
  button.removeAttribute('aria-pressed');
  named();
  button.addEventListener('click', () => {
    document.documentElement.dataset.theme = dark() ? 'light' : 'dark';
    named();
    redraw.forEach((job) => job());
  });
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => { named(); redraw.forEach((job) => job()); });
  // paper is white
  let before = null;
  addEventListener('beforeprint', () => {
    if (before !== null) return;
    before = document.documentElement.dataset.theme ?? '';
    document.documentElement.dataset.theme = 'light';
    document.documentElement.classList.add('printing');
    for (const el of document.querySelectorAll('details:not([open])')) { el.open = true; el.dataset.opened = ''; }
    state.flat = true;
    [...waiting.keys()].forEach(drawNow);
    redraw.forEach((job) => job());
    touchRows(rowsThatFill());
  });
  addEventListener('afterprint', () => {
    touchRows(null);
    forgetSheets();
    if (before) document.documentElement.dataset.theme = before;
    else delete document.documentElement.dataset.theme;
    document.documentElement.classList.remove('printing');
    for (const el of document.querySelectorAll('details[data-opened]')) { el.open = false; delete el.dataset.opened; }
    before = null;
    state.flat = false;
    redraw.forEach((job) => job());
  });
  // a turned telephone, another size of the window
  let resized = 0;
  addEventListener('resize', () => {
    clearTimeout(resized);
    resized = setTimeout(() => { if (before === null) redraw.forEach((job) => job()); }, 100);
  });

  /** The rows of the table of touches: a page of them, or as many as the paper has room for. Set where the table is made. */
  let touchRows = () => {};
  const PAGE_MM = 273, MOST_PAGES = 4;

  /** Elements before which a new sheet begins. */
  let begin = [];
  function forgetSheets() {
    for (const el of begin) el.style.breakBefore = '';
    begin = [];
  }

  /**
   * Divides the page into sheets, each piece whole and with its heading, and says how many touches fill the last sheet: the
   * rest of the sheet where the table begins, or, where little of it is left and sheets remain, most of the next one, too.
   */
  function rowsThatFill() {
    const FIRST = 4;
    touchRows(FIRST);
    forgetSheets();
    const px = id('main').getBoundingClientRect().width / 186; // the paper is 186 mm wide
    const sheet = PAGE_MM * px;
    const top = document.body.getBoundingClientRect().top;
    const seen = (el) => el.getClientRects().length > 0;
    const whole = '.pair, figure, .card, .verdict';
    // in the order in which it is printed
    const pieces = [...document.querySelectorAll(`${whole}, p, li, tr`)].filter((el) => seen(el) && !el.parentElement.closest(`${whole}, li, footer`)).map((el) => {
      let head = el.parentElement.matches('.grid') && !el.previousElementSibling ? el.parentElement : el;
      for (let up = head.previousElementSibling; up && (!seen(up) || up.matches('h2, h3, .keep')); up = up.previousElementSibling) if (seen(up)) head = up;
      return { el, head, from: head.getBoundingClientRect().top - top, to: el.getBoundingClientRect().bottom - top };
    }).sort((x, y) => x.from - y.from);
    let [shift, sheets, row] = [0, 1, 12];
    for (const { el, head, from, to } of pieces) {
      if (el.closest('#touches-table tbody')) row = to - from;
      if (to + shift <= (sheets - 0.01) * sheet) continue;
      if (from + shift < sheets * sheet && to - from < sheet) {
        shift += sheets * sheet - (from + shift);
        if (el.matches(whole) || head !== el) {
          head.style.breakBefore = 'page';
          begin.push(head);
        }
      }
      sheets += 1;
    }
    const last = id('foot').getBoundingClientRect().bottom - top + shift;
    // a little is kept back: a line breaks earlier on paper now and then
    const rest = (sheets - 0.04) * sheet - last;
    const rows = (room) => FIRST + Math.floor(room / row);
    const next = rows(rest) < 0 || (rest < 0.25 * sheet && sheets < MOST_PAGES);
    return Math.max(0, rows(next ? rest + 0.75 * sheet : rest));
  }

  // ---------------------------------------------------------------- the first screen
  const proposed = view.proposed.length > 0;
  plot(id('errors'), () => P.draw(id('errors'), charts.error, view), true);
  id('errors-says').textContent = `RMS of ${e.used} touches${view.ladder.some((r) => r.held_out_rms_um !== null) ? '; diamond: cross-validated, each index position left out of the fit in turn' : ''}. No model can fall below about the probe noise.`;
  plot(id('parameters'), () => P.draw(id('parameters'), charts.results, view), true);
  for (const line of view.headline.why) id('why').append(make('li', {}, line));
  const t = view.tolerance;
  const limit = `Shaded: tolerance ${t.error_um} µm at ${t.radius_mm} mm${t.stated ? '' : ' (default; set [tolerance] in the study)'}.`;
  id('parameters-says').append(
    proposed ? make('span.warn', {}, 'Values with the missing error in the model. Tick: without it; these values include part of the missing error. ')
      : view.diagnosis.verdict !== 'adequate' && view.parameters.some((p) => p.status !== 'undetermined') ? make('span.warn', {}, `These values ${view.diagnosis.faint || view.diagnosis.verdict === 'too-little-data' ? 'may include' : 'include'} part of the missing error. `) : '',
    `Circle: within, diamond: too large, square: uncertain. ${limit}`,
  );
  const copy = (text) => make('button.noprint', { type: 'button', 'aria-label': `copy the command ${text}`, onclick: async (ev) => {
    const code = ev.target.previousElementSibling;
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      // a browser that gives no clipboard to a file: the selection, and its own copying
      getSelection().selectAllChildren(code);
      if (!document.execCommand('copy')) return;
    }
    ev.target.textContent = 'copied';
  } }, 'copy');
  if (view.study.commands_run_in && view.next.some((n) => n.command)) id('next').before(make('p.muted', {}, view.study.commands_run_in));
  for (const n of view.next) {
    id('next').append(make('li', {}, make('strong', {}, n.what), make('span.how', {}, n.how), n.command ? make('div.command', {}, make('code', {}, n.command), copy(n.command)) : null));
  }

  // ---------------------------------------------------------------- results
  {
    const s = section('results', 'The results', proposed ? 'With the missing error in the model. The last column shows the values without it: do not use them.' : '');
    const list = proposed ? view.proposed : view.parameters;
    // what is wide is left away on a telephone: name, value and verdict stay
    const columns = [['error'], ['value ± 95 %', 'n'], ['verdict'], [`at ${t.radius_mm} mm, µm`, 'n', 1], ['tolerance', 'n', 1], ['std. unc.', 'n', 1], ...(proposed ? [['without it', 'n', 1]] : [])];
    const cell = (tag, k, attributes, ...inside) => make([tag, columns[k][1], columns[k][2] ? 'wide' : null].filter(Boolean).join('.'), attributes, ...inside);
    const body = list.map((p) => {
      const old = view.parameters.find((q) => q.name === p.name);
      const untold = p.status === 'undetermined';
      const word = untold ? 'not determined' : p.status === 'fixed' ? 'held' : p.judgement_says;
      const kind = { within: 'good', beyond: 'act', open: 'unknown' }[p.judgement] ?? '';
      const cells = [
        untold ? '?' : `${valued(p.value, p.sigma)}${p.expanded === null ? '' : ` ± ${digits(p.expanded, 2)}`} ${unitOf(p.unit)}`,
        make(`span.badge${kind ? `.${kind}` : ''}`, {}, word), untold ? '?' : digits(p.at_radius_um), p.tolerance === null ? '–' : `${digits(p.tolerance)} ${unitOf(p.unit)}`, digits(p.sigma, 2),
        ...(proposed ? [old ? valued(old.value, old.sigma) : '–'] : []),
      ];
      return make('tr', {}, cell('th', 0, { scope: 'row' }, p.name + (p.alias ? ` (${p.alias})` : ''), make('span.says', {}, p.says)), ...cells.map((v, k) => cell('td', k + 1, {}, v)));
    });
    s.append(make('table', { id: 'results-table' }, make('thead', {}, make('tr', {}, ...columns.map(([title], k) => cell('th', k, { scope: 'col' }, title)))), make('tbody', {}, ...body)));
    s.append(make('p.muted', {}, `${e.noise_says}. ${e.used} of ${e.touches} touches used, ${e.unknowns} unknowns. Model: ${view.study.effects.join(', ')}.`));
    for (const w of new Set(view.warnings)) s.append(make('p.warn', {}, w));
  }

  // ---------------------------------------------------------------- candidates
  const d = view.diagnosis;
  const PRINTED_CARDS = 3;
  if (d.candidates.length || d.where.length) {
    const s = section('candidates', d.verdict === 'adequate' ? 'What was looked for' : 'What may be missing', d.verdict === 'adequate'
      ? `${d.tested} known effects were tested on the residual, and none is found. These would be the next best; they do not pass.`
      : view.headline.detail || d.says);
    if (d.where.length && !view.headline.detail.includes(d.where[0].says)) s.append(make('p', {}, d.where[0].says));
    if (d.where.length > 1) s.append(make('details', {}, make('summary', {}, 'what else it depends on (one error may show in several ways)'), make('ul.plain', {}, ...d.where.slice(1).map((w) => make('li', {}, w.says)))));
    if (d.candidates.length) {
      const cards = make('div.grid.cards');
      const alike = (c) => [...c.same_as.map((a) => (d.effects[a] ? `${d.effects[a].name} (${a})` : a)), ...(c.or_else ? [c.or_else] : [])];
      d.candidates.forEach((c, k) => {
        const tried = c.held_out_before_um > 0 || c.held_out_after_um > 0;
        const least = c.p_adjusted < 1e-300 ? 'p below 10⁻³⁰⁰' : `p = ${digits(c.p_adjusted, 2)}`;
        const p = c.p_adjusted < 1e-4 ? 'less than 1 in 10 000' : c.p_adjusted > 0.5 ? 'as good as certain' : `1 in ${Math.round(1 / c.p_adjusted)}`;
        const fact = (name, value) => [make('dt', {}, name), make('dd', {}, value)];
        const mends = d.effects[c.effect]?.mends;
        cards.append(make('div.card', {}, make('h3', {}, `${k + 1}. ${c.name} `, make(c.proposed ? 'span.badge.act' : 'span.badge', {}, d.standings_say[k])),
          make('dl.facts', {}, ...fact('id', c.effect), ...(c.together_with ? fact('together with', d.effects[c.together_with]?.name ?? c.together_with) : []), ...fact('remaining error', `${digits(c.rms_after_um)} µm${c.together_with ? ' with both' : ''} (now ${digits(d.rms_um)} µm)`),
            ...fact('cross-validated error', tried ? `${digits(c.held_out_after_um)} µm (now ${digits(c.held_out_before_um)} µm${c.held_out_se_um ? `; the difference is known to ± ${digits(c.held_out_se_um, 2)} µm` : ''})` : 'cannot be tried with these poses'),
            ...fact('probability by noise alone', `${p} (${least}, all ${d.tested} effects counted in)`),
            ...fact('expected size', c.parameters.map((q) => `${q.name} = ${valued(q.value, q.sigma)}${q.sigma ? ` ± ${digits(q.sigma, 2)}` : ''} ${unitOf(q.unit)}`).join('; ') + (c.plausible ? '' : ' (unusually large)')),
            ...(alike(c).length ? fact('cannot be separated from', alike(c).join('; ')) : []),
            ...(c.tell_apart ? fact('what separates them', c.tell_apart) : []),
            ...(c.weakens?.length ? fact('makes less certain', c.weakens.map((w) => w.name).join(', ')) : [])),
          make('p', {}, c.says), c.look ? make('p', {}, make('strong', {}, 'Check at the machine: '), c.look) : null, mends ? make('p', {}, make('strong', {}, 'How to correct it: '), mends) : null));
      });
      s.append(cards);
      if (d.candidates.length > PRINTED_CARDS) s.append(make('p.onlyprint.muted', {}, `The cards of ${d.candidates.length - PRINTED_CARDS} more candidates are in the page on the screen.`));
    }
    for (const g of d.gross ?? []) s.append(make('p.warn', {}, `${g.says}: the error would be ${digits(g.rms_um)} µm`));
  }

  // ---------------------------------------------------------------- the ladder
  {
    const beside = pair();
    const s = section('ladder', 'Step by step to the noise', 'Remaining error of each model: lower is better, down to the noise. If the fitted error falls and the cross-validated error does not, the model fits noise.', beside);
    const [f, div] = figure('ladder-plot', [d.candidates.length ? 'Each index position is left out in turn. The cards of the candidates count only touches that the model without the candidate can predict too, so their figures differ.' : '', ...view.ladder_notes].filter(Boolean).join(' '));
    plot(div, () => P.draw(div, charts.ladder, view));
    s.append(f);
    if (d.candidates.length) {
      const c = section('candidates-compared', 'The candidates compared', '', beside);
      const [g, at] = figure('candidates-plot', 'Filled circle: proposed. Hollow circle: explains part. Cross: explains no more than noise could. Diamond: cross-validated error.');
      plot(at, () => P.draw(at, charts.candidates, view));
      c.append(g);
    }
  }

  // ---------------------------------------------------------------- residuals
  const select = (label, value, change) => {
    const el = make('select.noprint', { 'aria-label': label }, ...view.ladder.map((r, k) => make('option', { value: k, selected: k === value }, `${k}: ${r.label}`)));
    el.addEventListener('change', () => change(Number(el.value)));
    return el;
  };
  {
    const s = section('residuals', 'Residual of each touch, and what it depends on', 'Hollow marks: before; full marks: after; line: the added effect. A residual is a displacement of the ball in X, Y or Z of the machine. The shaded band is twice the probe noise.');
    const plots = [];
    const again = () => plots.forEach((job) => job());
    const looks = Object.values(charts).flatMap((c) => c.marks).filter((m) => m.mark === 'touches');
    const toggles = [0, 1, 2].map((l) => {
      const look = looks.find((m) => m.direction === l)?.look ?? {};
      const sign = { circle: '●', square: '■', triangle: '▲' }[look.shape];
      const b = make('button', { type: 'button', 'aria-pressed': 'true' }, make('span.swatch', { style: `color:${P.inkOf(look.ink, s)}`, 'aria-hidden': 'true' }, sign), `in ${'XYZ'[l]}`);
      b.addEventListener('click', () => {
        if (state.directions.has(l)) state.directions.delete(l); else state.directions.add(l);
        b.setAttribute('aria-pressed', state.directions.has(l));
        again();
      });
      return b;
    });
    const chosen = make('p.onlyprint.muted.keep', {});
    const words = () => { chosen.textContent = `before: ${view.ladder[state.from].label}; after: ${view.ladder[state.to].label}`; };
    words();
    const change = (key) => (v) => { state[key] = v; words(); again(); };
    s.append(make('div.controls.noprint', {}, make('span', {}, 'before: '), select('model shown as before', state.from, change('from')),
      make('span', {}, 'after: '), select('model shown as after', state.to, change('to')), ...toggles), chosen);
    const grid = make('div.grid.small');
    for (const v of [...view.variables].sort((a, b) => (b.share ?? -1) - (a.share ?? -1))) {
      const share = v.share !== null && d.verdict !== 'adequate' && v.share >= 0.05 ? `${Math.round(100 * v.share)} % of what the model does not explain depends on this` : '';
      const [f, div] = figure(`residual-${v.id}`, share);
      const job = () => P.draw(div, charts[`residual-${v.id.toLowerCase()}`], view, state);
      plots.push(() => { if (!waiting.has(div)) job(); });
      plot(div, job);
      grid.append(f);
    }
    // before the plots: on paper it would be alone on a page behind them
    s.append(make('p.keep', {}, view.comparison_says), grid);
  }

  // ---------------------------------------------------------------- the machine
  const machineAndDoubt = pair();
  {
    const s = section('machine', 'Where on the machine', 'All axes at zero. An arrow at each touch shows its residual.', machineAndDoubt);
    const [f, div] = figure('machine-plot', '', true);
    const scale = make('figcaption', {});
    const job = () => {
      const { times, bar_um: bar } = charts.machine.picture.scales[state.rung];
      scale.textContent = `Residuals of the model: ${view.ladder[state.rung].label}. Arrows are drawn ${times.toLocaleString('en')} times the residuals; the thick bar is ${digits(bar, 1)} µm. ${view.machine.says}.`;
      P.draw(div, charts.machine, view, state);
    };
    plot(div, job);
    f.append(scale);
    s.append(make('div.controls.noprint', {}, 'model: ', select('model whose residuals are drawn', state.rung, (v) => { state.rung = v; job(); })), f);
  }

  // ---------------------------------------------------------------- what is not told
  {
    const s = section('doubt', 'What cannot be determined', '', machineAndDoubt);
    const list = make('ul.plain');
    const effectName = (n) => d.effects[n]?.name ?? n;
    // what is said of several alike is said once
    const isSilent = (u) => Object.keys(u.combination).length === 1;
    const silent = view.undetermined.filter(isSilent);
    const others = silent.length > 2 ? view.undetermined.filter((u) => !isSilent(u)) : view.undetermined;
    const lines = others.map((u) => u.says);
    if (silent.length > 2) {
      const parted = [...new Set(silent.flatMap((u) => u.parted_by ?? []))];
      const takes = parted.length ? ` It would take: ${parted.join('; or ')}.` : '';
      lines.push(`These have no effect on these touches and cannot be determined; they stay at their start values: ${silent.map((u) => Object.keys(u.combination)[0]).join(', ')}.${takes}`);
    }
    for (const text of new Set([...lines, ...view.weak.map((w) => w.says)])) list.append(make('li', {}, text));
    if (d.not_seen.length) list.append(make('li', {}, `These effects cannot be seen with these touches (they move no touch, or the values of the model include all that they do): ${d.not_seen.map(effectName).join(', ')}.`));
    const seen = [...d.power].sort((a, b) => b.minimal_detectable_um - a.minimal_detectable_um).slice(0, 8);
    if (seen.length) list.append(make('li', {}, `Smallest size at which these effects would be found: ${seen.map((q) => `${effectName(q.effect)} ${digits(q.minimal_detectable_um, 2)} µm`).join(', ')}. All others of the ${d.tested} tried would have been found smaller.`));
    s.append(list.children.length ? list : make('p', {}, 'Every result of the model is determined.'));
    if (view.correlation.names.length > 1) {
      const [f, div] = figure('correlation-plot', proposed ? 'Correlation of the results of the present model: near 0 they are independent; near 1 or −1 only their difference or sum is well known.' : 'Correlation of the results: near 0 they are independent; near 1 or −1 only their difference or sum is well known.');
      div.style.height = `${Math.min(640, 160 + 34 * view.correlation.names.length)}px`;
      plot(div, () => P.draw(div, charts.correlation, view));
      s.append(f);
    }
  }

  // ---------------------------------------------------------------- compensation
  {
    const c = view.compensation;
    const s = section('compensation', 'The compensation, and what it leaves', c.active ? 'A compensation was active during the measurement: what was found is added to it.' : '');
    if (d.verdict === 'missing-effect' || d.verdict === 'unexplained') s.append(make('p.warn', {}, 'Do not load it yet: an effect is missing in the model, and these values include part of it.'));
    if (c.refused) s.append(make('p.warn', {}, c.refused));
    const table = (name, head, rows, from) => make('div.scroll', { tabindex: 0, role: 'region', 'aria-label': name }, make('table', {}, make('thead', {}, make('tr', {}, ...head.map((h, k) => make(k >= from[0] && k <= from[1] ? 'th.n' : 'th', { scope: 'col' }, h)))),
      make('tbody', {}, ...rows.map((r) => make('tr', {}, ...r.map((v, k) => make(k >= from[0] && k <= from[1] ? 'td.n' : 'td', {}, v)))))));
    const component = (q) => {
      if (q.place === 'zero') return 'where its zero is';
      const along = q.dof.at(-1).toUpperCase();
      const turns = q.place === 'after' ? `turns with ${q.axis}` : `does not turn with ${q.axis}`;
      return `${q.dof.startsWith('d') ? `position in ${along}` : `tilt about ${along}`}, ${turns}`;
    };
    const fixed = (v) => v.toFixed(5).replace('-', '−');
    if (c.terms.length) s.append(table('what the control is given', ['carried', 'axis', 'component', 'active before', 'found', 'given to the control', 'std. unc.', 'unit'], c.terms.map((q) => [q.parameter, q.axis, component(q), fixed(q.active_before), fixed(q.identified), fixed(q.value), digits(q.sigma, 2), unitOf(q.unit)]), [3, 6]));
    for (const q of c.shapes) s.append(make('p', {}, `${q.parameter} (${q.effect}): into the table of axis ${q.axis}.`));
    if (c.tool_length_mm !== null) s.append(make('p', {}, `Tool table: the tool is ${digits(c.tool_length_mm)} mm longer than was assumed.`));
    s.append(make('h3', {}, 'What it leaves'));
    s.append(c.left.length ? table('what the compensation leaves', ['not carried', 'effect', 'value', 'unit', `leaves at ${t.radius_mm} mm, µm`, 'why'], c.left.map((q) => [q.parameter, q.effect, digits(q.value), unitOf(q.unit), q.left_um === null ? '–' : digits(q.left_um), q.why]), [2, 2])
      : make('p', {}, `Nothing of what was found, whatever the control can carry: axiscal export says what its tables leave.${proposed ? '' : ` The remaining error is then about ${digits(view.ladder[e.after].rms_um)} µm, and the noise is ${digits(e.noise_um)} µm.`}`));
  }

  // ---------------------------------------------------------------- every touch
  {
    const s = section('touches', 'Every touch', '');
    const q = view.touches;
    const letters = Object.keys(q.axes).sort((a, b) => 'XYZABC'.indexOf(a) - 'XYZABC'.indexOf(b));
    const rows = q.id.map((_, i) => i).map((i) => ({ i, run: q.run[i], id: q.id[i], stage: q.words[q.stage[i]], block: q.words[q.block[i]], face: q.words[q.face[i]], ...Object.fromEntries(letters.map((l) => [l, q.axes[l][i]])), time: q.time_h[i],
      before: q.residual_um[e.before][i], after: q.residual_um[e.after][i], std: q.standardised[i], why: q.rejected[i] ?? '', source: P.source(view, i) }));
    for (const u of view.unusable) rows.push({ i: -1, run: u.run, id: u.id, stage: '', block: '', face: '', time: null, before: null, after: null, std: null, why: u.reason, source: `${view.study.runs[u.run - 1]?.log ?? 'log'}:${u.line}` });
    // of the study's own model, whose residual is in the column before
    const unusual = ['std', 'how unusual', 1, `The residual ${proposed ? 'before' : 'after'}, divided by the standard deviation that the other touches predict (studentised): noise alone seldom exceeds 4`];
    const columns = [['run', 'run', 1], ['id', 'touch', 1], ['stage', 'stage'], ['block', 'block'], ['face', 'face'], ...letters.map((l) => [l, `${l}, ${'ABC'.includes(l) ? '°' : 'mm'}`, 1]), ['time', 'time, h', 1], ['before', 'before, µm', 1], ...(proposed ? [unusual] : []), ['after', 'after, µm', 1], ...(proposed ? [] : [unusual]), ['why', 'not used because'], ['source', 'source line']];
    let size = 50;
    const sort = { by: 'after', down: true };
    let filter = '';
    let page = 0;
    const body = make('tbody');
    const count = make('span', { role: 'status' });
    const printed = make('p.onlyprint.muted', {});
    const previous = make('button', { type: 'button', onclick: () => { page -= 1; show(); } }, 'previous');
    const next = make('button', { type: 'button', onclick: () => { page += 1; show(); } }, 'next');
    const heads = columns.map(([key, title, number, says]) => {
      const th = make(number ? 'th.n' : 'th', { scope: 'col', title: says }, make('button', { type: 'button', onclick: () => {
        sort.down = sort.by === key ? !sort.down : Boolean(number);
        sort.by = key;
        page = 0;
        show();
      } }, title));
      th.dataset.key = key;
      return th;
    });
    const text = (key, v) => {
      if (v === null || v === undefined) return '';
      if (letters.includes(key) || key === 'time') return v.toFixed(3).replace('-', '−');
      if (['before', 'after', 'std'].includes(key)) return v.toFixed(2).replace('-', '−');
      return String(v);
    };
    function show() {
      const words = filter.toLowerCase().split(/\s+/).filter(Boolean);
      const kept = rows.filter((r) => words.every((w) => columns.some(([key]) => text(key, r[key]).toLowerCase().includes(w))));
      // residuals are sorted by size, whatever their sign
      const key = (r) => (['before', 'after', 'std'].includes(sort.by) && r[sort.by] !== null ? Math.abs(r[sort.by]) : r[sort.by]);
      kept.sort((a, b) => {
        const [x, y] = [key(a), key(b)];
        if (x === y) return a.i - b.i;
        if (x === null || x === undefined) return 1;
        if (y === null || y === undefined) return -1;
        return (x < y ? -1 : 1) * (sort.down ? -1 : 1);
      });
      const pages = Math.max(1, Math.ceil(kept.length / size));
      page = Math.min(Math.max(0, page), pages - 1);
      body.replaceChildren(...kept.slice(page * size, (page + 1) * size).map((r) => make(r.why ? 'tr.off' : 'tr', {}, ...columns.map(([k, , number]) => make(number ? 'td.n' : 'td', {}, text(k, r[k]))))));
      const ways = ['before', 'after', 'std'].includes(sort.by) && sort.down;
      printed.textContent = kept.length > size ? `${ways && page === 0 ? `The ${size} largest` : `${Math.min(size, kept.length - page * size)}`} of ${rows.length} touches; all of them are in the page on the screen.` : '';
      count.textContent = `${kept.length} of ${rows.length} touches, page ${page + 1} of ${pages}`;
      previous.disabled = page === 0;
      next.disabled = page === pages - 1;
      for (const th of heads) {
        const own = th.dataset.key === sort.by;
        th.setAttribute('aria-sort', own ? (sort.down ? 'descending' : 'ascending') : 'none');
        th.firstChild.textContent = columns.find(([k]) => k === th.dataset.key)[1] + (own ? (sort.down ? ' ▼' : ' ▲') : '');
      }
    }
    const input = make('input', { type: 'search', id: 'filter', placeholder: 'block, face, line …' });
    input.addEventListener('input', () => { filter = input.value; page = 0; show(); });
    s.append(make('p.muted', {}, `Before: ${view.ladder[e.before].label}; after: ${view.ladder[e.after].label}. Largest residuals first; the source line is the touch's place in the log. How unusual: the residual ${proposed ? 'before' : 'after'} divided by what the other touches predict; noise alone seldom exceeds 4.`), printed,
      make('div.controls.noprint', {}, make('label', { for: 'filter' }, 'show only'), input, previous, next, count),
      make('div.scroll', { id: 'touches-table', tabindex: 0, role: 'region', 'aria-label': 'table of the touches' }, make('table', {}, make('thead', {}, make('tr', {}, ...heads)), body)));
    touchRows = (printed) => { size = printed ?? 50; page = 0; show(); };
    show();
  }

  id('foot').append(
    make('p', {}, `${view.program}; study ${view.study.name}, SHA-256 ${view.study.sha256}; data of ${view.study.date}. Runs: ${view.study.runs.map((r) => `${r.program} (${r.plan}, ${r.log}, ${r.controller}, ${r.touches} touches)`).join('; ')}.`),
    make('p', {}, 'Residual: measured minus model, along the outward normal of the touched face. Names of errors follow ISO 230-1 and 230-7. Bars and ± are 95 % unless they are called standard uncertainties. Plots: plotly.js, MIT licence.'),
  );
  document.documentElement.dataset.ready = 'yes';
})();
