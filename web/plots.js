// Every plot of the report and the workbench: each takes an element and a view (axiscal-view/1) and draws it with Plotly.
// No plot computes: it picks columns of the view. Colours: Okabe and Ito's set, which colour-blind people tell apart;
// what has a colour has a shape or a dash, too.
'use strict';
globalThis.axiscalPlots = (() => {
  const OKABE = { orange: '#E69F00', sky: '#56B4E9', green: '#009E73', yellow: '#F0E442', blue: '#0072B2', red: '#D55E00', purple: '#CC79A7' };
  const STAGES = [OKABE.blue, OKABE.red, OKABE.green, OKABE.purple, OKABE.orange, OKABE.sky];
  // one colour, one shape and one dash for each direction of R
  const DIRECTION = {
    X: { colour: OKABE.blue, light: OKABE.sky, symbol: 'circle', dash: 'solid' },
    Y: { colour: OKABE.red, light: OKABE.orange, symbol: 'square', dash: 'dash' },
    Z: { colour: OKABE.green, light: OKABE.green, symbol: 'triangle-up', dash: 'dot' },
    normal: { colour: OKABE.purple, light: OKABE.purple, symbol: 'diamond', dash: 'solid' },
  };
  const LETTERS = ['X', 'Y', 'Z'];
  const MANY = 4000; // more points than this are drawn by the graphics card

  // Plotly reads a few HTML tags in its texts: names come from files of the user's own
  const safe = (text) => String(text).replaceAll('&', '&amp;').replaceAll('<', '&lt;').replaceAll('>', '&gt;');

  /** The title of an axis; a degree has its sign on a page. */
  const titleOf = (variable) => safe(variable.title).replace(/, deg$/, ', °');

  /** Three significant digits, plainly written. */
  function digits(x, n = 3) {
    if (x === null || x === undefined || !Number.isFinite(x)) return '–';
    if (x === 0) return '0';
    const magnitude = Math.floor(Math.log10(Math.abs(x)));
    if (magnitude < -7 || magnitude > 6) return x.toExponential(n - 1);
    return x.toFixed(Math.max(0, n - 1 - magnitude)).replace('-', '−');
  }

  /** A value with the digits that its uncertainty leaves. */
  function valued(x, sigma) {
    if (x === null || x === undefined) return '–';
    if (!sigma || !Number.isFinite(sigma)) return digits(x);
    const places = Math.min(9, Math.max(0, 1 - Math.floor(Math.log10(sigma))));
    return (Number(x.toFixed(places)) + 0).toFixed(places).replace(/^-(?=[0.]*$)/, '').replace('-', '−');
  }

  const colours = (el) => {
    const style = getComputedStyle(el);
    const of = (name) => style.getPropertyValue(name).trim();
    return { ink: of('--ink'), paper: of('--paper'), muted: of('--muted'), grid: of('--grid'), band: of('--band'), good: of('--good'), act: of('--act') };
  };

  function layout(el, more = {}) {
    const c = colours(el);
    const axis = { gridcolor: c.grid, zerolinecolor: c.muted, linecolor: c.muted, tickcolor: c.muted, automargin: true, ticks: 'outside', ticklen: 3 };
    const out = {
      paper_bgcolor: 'rgba(0,0,0,0)', plot_bgcolor: 'rgba(0,0,0,0)',
      font: { family: 'system-ui, sans-serif', size: 12, color: c.ink },
      margin: { l: 8, r: 12, t: 8, b: 44 }, showlegend: false, hoverlabel: { font: { family: 'system-ui, sans-serif' } },
      // stated, so that a page which is made ready for the printer is drawn in its new size at once
      dragmode: 'zoom', width: el.clientWidth || undefined, height: el.clientHeight || undefined, ...more,
    };
    for (const name of ['xaxis', 'yaxis']) {
      // below, the margin is given: names that need more room ask for it
      out[name] = { ...axis, automargin: name === 'yaxis' || Boolean(more[name]?.ticktext), ...more[name] };
      if (out[name].title) out[name].title = { standoff: 8, ...out[name].title };
    }
    return out;
  }

  const CONFIG = { displaylogo: false, responsive: true, displayModeBar: false, doubleClick: 'reset', showTips: false };

  function draw(el, traces, lay, label) {
    if (label) {
      el.setAttribute('role', 'img');
      el.setAttribute('aria-label', label);
    }
    return Plotly.react(el, traces, lay, CONFIG);
  }

  /** On paper there is less room for words. */
  const narrow = (el, px) => el.clientWidth > 0 && el.clientWidth < px;

  const rungName = (view, i) => view.ladder[i].label;

  /** The error before and after, against the noise. */
  function errors(el, view) {
    const c = colours(el);
    const { before, after, noise_um: noise } = view.errors;
    const proposed = view.ladder[after].kind === 'proposed';
    const rows = [
      { i: before, name: view.ladder[before].kind === 'uncorrected' ? 'the machine<br>uncorrected' : 'before<br>(model now)', colour: OKABE.red },
      { i: after, name: proposed ? `after, with<br>${safe(view.ladder[after].added.join(', '))}` : 'after<br>(remaining)', colour: OKABE.blue },
    ].filter((r, k, all) => k === 0 || r.i !== all[0].i);
    const values = rows.map((r) => view.ladder[r.i].rms_um);
    // as many unknowns as touches leave nothing but the computer's rounding
    rows.forEach((r, k) => { r.name = `${r.name}<br><b>${values[k] < 5e-4 ? '0' : digits(values[k])} µm</b>`; });
    const top = Math.max(...values, noise);
    const traces = [{
      type: 'bar', orientation: 'h', y: rows.map((r) => r.name), x: values,
      marker: { color: rows.map((r) => r.colour) }, width: 0.5,
      hoverinfo: 'skip',
    }];
    const held = rows.map((r) => view.ladder[r.i].held_out_rms_um);
    if (held.some((h) => h !== null)) {
      traces.push({
        type: 'scatter', mode: 'markers', y: rows.map((r) => r.name), x: held, marker: { symbol: 'diamond-open', size: 11, color: c.ink, line: { width: 2 } },
        hovertemplate: 'cross-validated: %{x:.2f} µm<extra></extra>',
      });
    }
    const lay = layout(el, {
      margin: { l: 8, r: 14, t: 26, b: 44 },
      xaxis: { title: { text: narrow(el, 330) ? 'error (RMS), µm' : 'error of the touches (RMS), µm' }, range: [0, 1.1 * Math.max(top, ...held.filter((h) => h !== null), 0)] },
      yaxis: { autorange: 'reversed', ticks: '' },
      shapes: [{ type: 'line', x0: noise, x1: noise, y0: 0, y1: 1, yref: 'paper', line: { color: c.ink, width: 2, dash: 'dash' } }],
      annotations: [{ x: noise, y: 1, yref: 'paper', yanchor: 'bottom', xanchor: noise > 0.6 * top ? 'right' : 'left', showarrow: false, text: `probe noise ${digits(noise)} µm`, font: { size: 11 } }],
    });
    const say = rows.map((r) => r.name.replace(/<[^>]*>/g, ' ')).join('; ');
    return draw(el, traces, lay, `Error of the touches: ${say}; the probe noise is ${digits(noise)} µm.`);
  }

  const JUDGEMENTS = { within: { symbol: 'circle', colour: OKABE.blue, word: 'within' }, beyond: { symbol: 'diamond', colour: OKABE.red, word: 'too large' }, open: { symbol: 'square', colour: OKABE.orange, word: 'uncertain' }, none: { symbol: 'x', colour: '#888888', word: 'no tolerance' } };

  /** The results with their doubt against the tolerance, all as µm at one radius. */
  function parameters(el, view, most = 12) {
    const c = colours(el);
    const list = view.proposed.length ? view.proposed : view.parameters;
    const sized = list.filter((p) => p.at_radius_um !== null && p.status !== 'undetermined');
    const ratio = (p) => Math.abs(p.at_radius_um) / (p.tolerance_um || view.tolerance.error_um);
    const shown = [...sized].sort((a, b) => ratio(b) - ratio(a)).slice(0, most);
    shown.sort((a, b) => sized.indexOf(a) - sized.indexOf(b));
    const name = (p) => `${safe(p.says)} <b>${safe(p.name)}</b>`;
    if (!shown.length) {
      const none = layout(el, { xaxis: { visible: false }, yaxis: { visible: false }, annotations: [{ x: 0.5, y: 0.5, xref: 'paper', yref: 'paper', showarrow: false, text: 'no error can be determined' }] });
      return draw(el, [], none, 'These touches determine no error of the machine.');
    }
    const y = shown.map(name);
    const kinds = shown.map((p) => JUDGEMENTS[p.judgement]);
    const traces = [];
    if (view.proposed.length) {
      const now = shown.map((p) => view.parameters.find((q) => q.name === p.name));
      traces.push({
        type: 'scatter', mode: 'markers', x: now.map((p) => (p ? p.at_radius_um : null)), y,
        // a tick, which no judgement's mark looks like, and which none covers
        marker: { symbol: 'line-ns-open', size: 18, color: c.ink, line: { width: 2 } },
        hovertemplate: 'with the model as it is: %{x:.2f} µm<extra></extra>',
      });
    }
    traces.push({
      type: 'scatter', mode: 'markers', x: shown.map((p) => p.at_radius_um), y,
      error_x: { type: 'data', array: shown.map((p) => p.at_radius_expanded_um), color: c.ink, thickness: 2, width: 0 },
      marker: { symbol: kinds.map((k) => k.symbol), size: 10, color: kinds.map((k) => k.colour) },
      customdata: shown.map((p) => [`${valued(p.value, p.sigma)} ± ${digits(p.expanded, 2)} ${p.unit}`, JUDGEMENTS[p.judgement].word]),
      hovertemplate: '%{y}: %{x:.2f} µm at the radius, %{customdata[0]} (95 %), %{customdata[1]}<extra></extra>',
    });
    const tolerance = (p) => p.tolerance_um;
    const shapes = shown.flatMap((p, i) => (tolerance(p) ? [{
      type: 'rect', x0: -tolerance(p), x1: tolerance(p), y0: i - 0.5, y1: i + 0.5, fillcolor: c.band, line: { width: 0 }, layer: 'below',
    }] : []));
    const reach = 1.08 * Math.max(view.tolerance.error_um * 1.15, ...shown.map((p) => Math.abs(p.at_radius_um) + (p.at_radius_expanded_um || 0)));
    const lay = layout(el, {
      margin: { l: 8, r: 12, t: 8, b: 44 }, shapes,
      xaxis: { title: { text: `error at ${view.tolerance.radius_mm} mm, µm${narrow(el, 450) ? '' : ' (bar: 95 %)'}` }, range: [-reach, reach], zeroline: true },
      yaxis: { autorange: 'reversed', ticks: '', gridcolor: 'rgba(0,0,0,0)', tickfont: { size: 11 } },
    });
    const say = shown.map((p) => `${p.name} ${digits(p.at_radius_um)} ± ${digits(p.at_radius_expanded_um, 2)} µm (${JUDGEMENTS[p.judgement].word})`).join('; ');
    return draw(el, traces, lay, `Results as error at ${view.tolerance.radius_mm} mm against the tolerance of ${view.tolerance.error_um} µm: ${say}.`);
  }

  /** The ladder, falling to the noise. */
  function ladder(el, view) {
    const c = colours(el);
    const x = view.ladder.map((_, i) => i);
    const names = view.ladder.map((r) => safe(r.label).replace(/ (?=\S{12})/g, '<br>'));
    const noise = view.errors.noise_um;
    const traces = [
      { type: 'scatter', mode: 'lines+markers+text', x, y: view.ladder.map((r) => r.rms_um), line: { color: OKABE.blue, width: 3, shape: 'hv' }, marker: { size: 10, color: OKABE.blue, symbol: view.ladder.map((r) => (r.kind === 'proposed' ? 'circle-open' : 'circle')) }, text: view.ladder.map((r) => `${digits(r.rms_um)}`), textposition: view.ladder.map((r) => (r.rms_um < noise ? 'middle right' : 'top right')), name: 'fitted', hovertemplate: '%{y:.3f} µm<extra>fitted</extra>', cliponaxis: false },
      { type: 'scatter', mode: 'markers', x, y: view.ladder.map((r) => r.held_out_rms_um), marker: { size: 12, symbol: 'diamond-open', color: OKABE.red, line: { width: 2 } }, name: 'cross-validated', hovertemplate: '%{y:.3f} µm<extra>cross-validated</extra>' },
    ];
    const all = view.ladder.flatMap((r) => [r.rms_um, r.held_out_rms_um]).filter((v) => v > 0).concat(noise);
    const wide = Math.max(...all) / Math.min(...all) > 12;
    const small = narrow(el, 450);
    const lay = layout(el, {
      showlegend: true, legend: { orientation: 'h', y: 1.02, yanchor: 'bottom', x: 0 }, margin: { l: 8, r: 30, t: small ? 34 : 44, b: 44 },
      xaxis: { tickvals: x, ticktext: names, range: [-0.35, x.length - 0.45], zeroline: false, ...(small ? { tickfont: { size: 10 } } : {}), title: { text: 'model, step by step' } },
      yaxis: { title: { text: small ? 'RMS, µm' : 'remaining error (RMS), µm' }, ...(wide ? { type: 'log', tickvals: [-3, -2, -1, 0, 1, 2, 3].flatMap((k) => (small ? [1] : [1, 2, 5]).map((f) => Number((f * 10 ** k).toPrecision(3)))), range: [Math.log10(0.6 * Math.min(...all)), Math.log10((small ? 3 : 1.8) * Math.max(...all))] } : { range: [0, 1.15 * Math.max(...all)] }) },
      shapes: [{ type: 'line', x0: 0, x1: 1, xref: 'paper', y0: noise, y1: noise, line: { color: c.ink, width: 2, dash: 'dash' } }],
      annotations: [{ x: 0, xref: 'paper', xanchor: 'left', xshift: 4, y: wide ? Math.log10(noise) : noise, yanchor: 'top', yshift: -2, showarrow: false, text: `probe noise ${digits(noise)} µm`, font: { size: small ? 10 : 12 } }],
    });
    return draw(el, traces, lay, `Remaining error of each model: ${view.ladder.map((r) => `${r.label} ${digits(r.rms_um)} µm`).join(', ')}; the probe noise is ${digits(noise)} µm.`);
  }

  /** Where a touch is found again. */
  function source(view, i) {
    const t = view.touches;
    return `${view.study.runs[t.run[i] - 1]?.log ?? 'log'}:${t.line[i]}`;
  }

  function about(view, i) {
    const t = view.touches;
    const pose = Object.keys(t.axes).filter((a) => 'ABC'.includes(a)).map((a) => `${a}${digits(t.axes[a][i])}°`).join(' ');
    return safe(`touch ${t.id[i]}, ${t.words[t.block[i]]} ${t.words[t.face[i]]}, ${pose}, ${source(view, i)}`);
  }

  function column(view, id) {
    const t = view.touches;
    switch (id) {
      case 'time': return t.time_h;
      case 'order': return t.id.map((_, i) => i + 1);
      case 'approach': return t.approach_deg;
      case 'stylus': return t.stylus_mm;
      default: return t.axes[id];
    }
  }

  /**
   * How far the touches miss, against one variable, with two models of the ladder; the line is what the second has and
   * the first has not. options: from, to (rungs), directions (set of X Y Z), highlight (numbers of touches).
   */
  function residuals(el, view, variable, options = {}) {
    const c = colours(el);
    const { from = view.errors.before, to = view.errors.after, directions = new Set(LETTERS), highlight = [] } = options;
    const t = view.touches;
    const x = column(view, variable.id);
    const alongNormal = variable.id === 'approach';
    const type = t.n > MANY ? 'scattergl' : 'scatter';
    const traces = [];
    const set = (rung, keep, factor) => ({ x: keep.map((i) => x[i]), y: keep.map((i) => factor(i) * t.residual_um[rung][i]), ids: keep });
    for (const d of alongNormal ? ['normal'] : LETTERS.filter((l) => directions.has(l))) {
      const keep = [];
      for (let i = 0; i < t.n; i += 1) {
        if (t.rejected[i] === null && x[i] !== null && (alongNormal || LETTERS[t.towards[i]] === d)) keep.push(i);
      }
      if (!keep.length) continue;
      const factor = alongNormal ? () => 1 : (i) => t.sign[i];
      const style = DIRECTION[d];
      const add = (rung, marker, word) => {
        const s = set(rung, keep, factor);
        traces.push({ type, mode: 'markers', x: s.x, y: s.y, customdata: s.ids, marker, text: s.ids.map((i) => about(view, i)), hovertemplate: `%{text}<br>${word}: %{y:.2f} µm<extra></extra>` });
      };
      if (from !== to) add(from, { symbol: `${style.symbol}-open`, size: 6, color: style.colour, opacity: 0.45 }, 'before');
      add(to, { symbol: style.symbol, size: 4, color: style.colour, opacity: 0.85 }, from === to ? 'residual' : 'after');
      for (const curve of view.curves.filter((k) => k.variable === variable.id && k.direction === d && k.from === from && k.to === to)) {
        traces.push({ type: 'scatter', mode: 'lines', x: curve.x, y: curve.y_um, line: { color: style.colour, width: 2.5, dash: style.dash }, hovertemplate: `the added effect: %{y:.2f} µm<extra>${d}</extra>` });
      }
    }
    const marked = highlight.filter((i) => x[i] !== null && x[i] !== undefined);
    if (marked.length) {
      const factor = (i) => (alongNormal ? 1 : t.sign[i]);
      traces.push({ type: 'scatter', mode: 'markers', x: marked.map((i) => x[i]), y: marked.map((i) => factor(i) * t.residual_um[to][i]), marker: { symbol: 'circle-open', size: 15, color: c.ink, line: { width: 3 } }, hoverinfo: 'skip' });
    }
    const noise = 2 * view.errors.noise_um;
    const small = narrow(el, 260);
    const lay = layout(el, {
      ...(small ? { margin: { l: 4, r: 6, t: 4, b: alongNormal ? 46 : 34 } } : {}),
      xaxis: { title: { text: small ? titleOf(variable).replace(' about ', '<br>about ') : titleOf(variable), ...(narrow(el, 360) ? { font: { size: 10 } } : {}) }, zeroline: false, ...(small ? { nticks: 5, tickangle: 0, tickfont: { size: 9 } } : {}) },
      yaxis: { title: { text: alongNormal && !small ? 'residual along the normal, µm' : 'residual, µm', ...(small ? { font: { size: 10 } } : {}) }, zeroline: true, ...(small ? { nticks: 5, tickfont: { size: 9 } } : {}) },
      shapes: [{ type: 'rect', x0: 0, x1: 1, xref: 'paper', y0: -noise, y1: noise, fillcolor: c.band, line: { width: 0 }, layer: 'below' }],
      hovermode: 'closest',
    });
    const share = variable.share ? ` ${Math.round(100 * variable.share)} % of the unexplained error depends on it.` : '';
    return draw(el, traces, lay, `Residuals in µm against ${variable.title}; ${view.ladder[from].label} and ${view.ladder[to].label}.${share}`);
  }

  // ---------------------------------------------------------------- the machine
  const sum = (a, b, k = 1) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];

  function boxLines(centre, size) {
    const corner = (i, j, k) => [centre[0] + (i - 0.5) * size[0], centre[1] + (j - 0.5) * size[1], centre[2] + (k - 0.5) * size[2]];
    const out = [];
    for (const a of [0, 1]) {
      for (const b of [0, 1]) {
        out.push([corner(0, a, b), corner(1, a, b)], [corner(a, 0, b), corner(a, 1, b)], [corner(a, b, 0), corner(a, b, 1)]);
      }
    }
    return out;
  }

  function ring(foot, direction, radius) {
    const other = Math.abs(direction[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
    const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let u = cross(direction, other);
    const l = Math.hypot(...u);
    u = u.map((v) => v / l);
    const w = cross(direction, u);
    const at = (k) => sum(sum(foot, u, radius * Math.cos(k)), w, radius * Math.sin(k));
    return Array.from({ length: 48 }, (_, k) => [at((k * Math.PI) / 24), at(((k + 1) * Math.PI) / 24)]);
  }

  /** What is touched: a box by its edges, a sphere by three circles, a cylinder or a hole by its two ends. */
  function bodyLines(b) {
    const radius = (b.diameter ?? 0) / 2;
    if (b.form === 'sphere') return [[1, 0, 0], [0, 1, 0], [0, 0, 1]].flatMap((d) => ring(b.centre, d, radius));
    if (b.form !== 'cylinder' && b.form !== 'bore') return boxLines(b.centre, b.size);
    const ends = [-0.5, 0.5].flatMap((k) => ring(sum(b.centre, [0, 0, 1], k * b.size[2]), [0, 0, 1], radius));
    return b.form === 'bore' ? [...ends, ...boxLines(b.centre, b.size)] : ends;
  }

  /** 1, 2 or 5 times a power of ten, not above x. */
  function round125(x) {
    const power = 10 ** Math.floor(Math.log10(x));
    const rest = x / power;
    return power * (rest >= 5 ? 5 : rest >= 2 ? 2 : 1);
  }

  /** Lines, arrows and words of the picture of the machine, in R with all axes at zero, mm. */
  function machineParts(view, rung) {
    const m = view.machine;
    const t = view.touches;
    const stages = [...new Set(t.stage)];
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (const p of t.point) for (let k = 0; k < 3; k += 1) { low[k] = Math.min(low[k], p[k]); high[k] = Math.max(high[k], p[k]); }
    const extent = Math.max(20, ...high.map((h, k) => h - low[k]));
    const centre = low.map((l, k) => (l + high[k]) / 2);
    const sizes = [];
    for (let i = 0; i < t.n; i += 1) if (t.rejected[i] === null) sizes.push(Math.abs(t.residual_um[rung][i]));
    sizes.sort((a, b) => a - b);
    const large = Math.max(sizes[Math.floor(0.98 * sizes.length)] ?? 1, 1e-3);
    // an arrow of the largest misses is a quarter of the artefact long
    const magnification = round125((0.25 * extent) / (large / 1000));
    const arrows = stages.map((stage) => {
      const shafts = [];
      const tips = [];
      const which = [];
      for (let i = 0; i < t.n; i += 1) {
        if (t.stage[i] !== stage || t.rejected[i] !== null) continue;
        const tip = sum(t.point[i], t.normal[i], (t.residual_um[rung][i] / 1000) * magnification);
        shafts.push([t.point[i], tip]);
        tips.push(tip);
        which.push(i);
      }
      return { name: t.words[stage], shafts, tips, which };
    });
    const rejected = t.rejected.flatMap((r, i) => (r === null ? [] : [i]));
    const blocks = m.blocks.flatMap(bodyLines);
    const table = m.solids.flatMap((s) => {
      if (!s.radius_height) return boxLines(s.at, s.size);
      const end = sum(s.at, s.direction, s.radius_height[1]);
      return [...ring(s.at, s.direction, s.radius_height[0]), ...ring(end, s.direction, s.radius_height[0])];
    });
    const axes = m.axes.map((a) => {
      const half = 0.75 * extent;
      // a linear axis has no place: it is drawn beside the artefact; a rotary one through the point of its line next to it
      let at = [low[0] - 0.25 * extent, low[1] - 0.25 * extent, low[2] - 0.1 * extent];
      if (a.rotary) {
        const along = centre.reduce((s, v, k) => s + (v - a.point[k]) * a.direction[k], 0);
        at = sum(a.point, a.direction, along);
      }
      const from = a.rotary ? sum(at, a.direction, -half) : at;
      const to = a.rotary ? sum(at, a.direction, half) : sum(at, a.direction, 0.4 * extent);
      return { name: a.name, rotary: a.rotary, line: [from, to] };
    });
    const scaleUm = round125((1000 * 0.25 * extent) / magnification);
    const foot = [high[0] + 0.2 * extent, low[1] - 0.2 * extent, low[2]];
    const scale = { um: scaleUm, line: [foot, sum(foot, [0, 0, 1], (scaleUm / 1000) * magnification)] };
    return { arrows, rejected, blocks, table, axes, scale, magnification, extent, centre };
  }

  const path = (lines, map) => {
    const out = [[], [], []];
    for (const [a, b] of lines) {
      for (const p of [map(a), map(b)]) p.forEach((v, k) => out[k].push(v));
      out.forEach((o) => o.push(null));
    }
    return out;
  };

  let webgl;
  function hasWebgl() {
    if (webgl === undefined) {
      try {
        webgl = Boolean(document.createElement('canvas').getContext('webgl'));
      } catch {
        webgl = false;
      }
    }
    return webgl;
  }

  /** More arrows than this have no heads: they would take too long. */
  const MOST_HEADS = 2500;

  /** The heads of arrows: cones whose point is the arrow's end. */
  function arrowHeads(view, rung, arrows, colour, extent) {
    const t = view.touches;
    const length = arrows.shafts.map(([a, b]) => Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]));
    // a third of its arrow, at most
    const size = length.map((l) => Math.min(l / 2.5, 0.04 * extent));
    const of = (k) => arrows.tips.map((p) => p[k]);
    const along = (k) => arrows.which.map((i, n) => size[n] * t.normal[i][k] * Math.sign(t.residual_um[rung][i]));
    return {
      type: 'cone', x: of(0), y: of(1), z: of(2), u: along(0), v: along(1), w: along(2), anchor: 'tip', sizemode: 'raw', sizeref: 1,
      colorscale: [[0, colour], [1, colour]], showscale: false, legendgroup: arrows.name, showlegend: false, hoverinfo: 'skip',
    };
  }

  /** The machine with the miss of every touch as an arrow. options: rung, flat (drawn without a graphics card). */
  function machine(el, view, options = {}) {
    const c = colours(el);
    const rung = options.rung ?? view.errors.before;
    const parts = machineParts(view, rung);
    const flat = options.flat || !hasWebgl();
    // seen from the front, right, above: X to the right, Z up
    const [ca, sa, ce, se] = [Math.cos(-0.6), Math.sin(-0.6), Math.cos(0.5), Math.sin(0.5)];
    const map = flat ? (p) => [ca * p[0] - sa * p[1], ce * p[2] + se * (sa * p[0] + ca * p[1])] : (p) => p;
    const type = flat ? 'scatter' : 'scatter3d';
    const lines = (l, line, more = {}) => {
      const [x, y, z] = path(l, map);
      return { type, mode: 'lines', x, y, ...(flat ? {} : { z }), line, hoverinfo: 'skip', showlegend: false, ...more };
    };
    const marks = (points, marker, more = {}) => {
      const [x, y, z] = [0, 1, 2].map((k) => points.map((p) => map(p)[k]));
      return { type, mode: 'markers', x, y, ...(flat ? {} : { z }), marker, showlegend: false, ...more };
    };
    const traces = [
      lines(parts.table, { color: c.muted, width: 1 }),
      lines(parts.blocks, { color: c.ink, width: flat ? 1.5 : 3 }),
    ];
    parts.arrows.forEach((a, k) => {
      const colour = STAGES[k % STAGES.length];
      traces.push(lines(a.shafts, { color: colour, width: flat ? 1.5 : 4 }, { name: safe(a.name), legendgroup: a.name, showlegend: true }));
      const heads = !flat && a.tips.length <= MOST_HEADS;
      if (heads) traces.push(arrowHeads(view, rung, a, colour, parts.extent));
      // what is pointed at; seen only where there are no heads
      traces.push(marks(a.tips, { size: flat ? 5 : 4, color: colour, symbol: 'diamond', opacity: heads ? 0 : 1 }, {
        legendgroup: a.name, customdata: a.which, text: a.which.map((i) => `${about(view, i)}<br>residual ${digits(view.touches.residual_um[rung][i])} µm`), hovertemplate: '%{text}<extra></extra>',
      }));
    });
    if (parts.rejected.length) {
      traces.push(marks(parts.rejected.map((i) => view.touches.point[i]), { symbol: 'x', size: flat ? 9 : 5, color: c.ink }, { name: 'not used', showlegend: true, text: parts.rejected.map((i) => about(view, i)), hovertemplate: '%{text}: not used<extra></extra>' }));
    }
    const word = (text, p) => {
      const [x, y, z] = map(p);
      return { type, mode: 'text', x: [x], y: [y], ...(flat ? {} : { z: [z] }), text: [text], textfont: { size: 14, color: c.ink }, hoverinfo: 'skip', showlegend: false };
    };
    for (const a of parts.axes) {
      traces.push(lines([a.line], { color: c.ink, width: flat ? 1.5 : 3, dash: a.rotary ? 'dashdot' : 'solid' }), word(`<b>${a.name}</b>`, a.line[1]));
    }
    traces.push(lines([parts.scale.line], { color: c.ink, width: flat ? 4 : 8 }), word(`${digits(parts.scale.um, 1)} µm`, parts.scale.line[1]));
    const common = { margin: { l: 0, r: 0, t: 4, b: 4 }, showlegend: true, legend: { title: { text: document.documentElement.classList.contains('printing') ? 'stage' : 'stage (click hides)' }, x: 0, y: 1, bgcolor: 'rgba(0,0,0,0)' } };
    const off = { visible: false, showgrid: false, zeroline: false };
    const side = (title) => ({ title: { text: title }, color: c.ink, gridcolor: c.grid, zerolinecolor: c.grid, backgroundcolor: 'rgba(0,0,0,0)', range: undefined });
    // the touches fill the picture; the table may be cut
    const r = flat ? 1.05 * parts.extent : 0.76 * parts.extent;
    const lay = flat
      ? layout(el, { ...common, xaxis: { ...off, range: undefined }, yaxis: { ...off, scaleanchor: 'x' } })
      : layout(el, { ...common, scene: { aspectmode: 'cube', camera: { eye: { x: 1.1, y: -1.47, z: 0.74 }, center: { x: 0, y: 0, z: -0.18 } },
        xaxis: { ...side('X, mm'), range: [parts.centre[0] - r, parts.centre[0] + r] },
        yaxis: { ...side('Y, mm'), range: [parts.centre[1] - r, parts.centre[1] + r] },
        zaxis: { ...side('Z, mm'), range: [parts.centre[2] - r, parts.centre[2] + r] } } });
    if (flat) {
      const around = map(parts.centre);
      lay.xaxis.range = [around[0] - 1.5 * r, around[0] + 1.5 * r];
      lay.yaxis.range = [around[1] - 1.2 * r, around[1] + r];
    }
    el.dataset.magnification = parts.magnification;
    return draw(el, traces, lay, `The machine with its blocks; an arrow at each touch shows its residual (${view.ladder[rung].label}), ${parts.magnification} times enlarged.`)
      .then(() => parts);
  }

  /** How the results hang together. */
  function correlation(el, view) {
    const c = colours(el);
    const { names, matrix } = view.correlation;
    const traces = [{
      type: 'heatmap', x: names, y: names, z: matrix, zmin: -1, zmax: 1,
      // blue to orange over the paper: also for colour-blind people
      colorscale: [[0, OKABE.blue], [0.5, c.paper], [1, OKABE.red]], colorbar: { title: { text: 'correlation' }, thickness: 12, tickvals: [-1, -0.5, 0, 0.5, 1] },
      text: matrix.map((row) => row.map((r) => (r === null ? '' : r.toFixed(2).replace('-0.00', '0.00').replace('-', '−')))), texttemplate: names.length <= 12 ? '%{text}' : '', xgap: 1, ygap: 1,
      hovertemplate: '%{y} and %{x}: %{z:.2f}<extra></extra>',
    }];
    const lay = layout(el, { margin: { l: 8, r: 10, t: 10, b: 8 }, yaxis: { autorange: 'reversed', ticks: '' }, xaxis: { ticks: '', tickangle: -45, automargin: true } });
    return draw(el, traces, lay, `Correlation of the results of the model now, from −1 to 1: ${names.join(', ')}.`);
  }

  /** How a candidate stands: passed, tried on touches left out, first of all; in words, and as a mark. */
  const LEVEL = 0.05;
  const tried = (k) => k.held_out_before_um > 0 || k.held_out_after_um > 0;
  function standing(d, k) {
    if (k.proposed) return { word: 'proposed', symbol: 'circle', proposed: true };
    if (!(k.p_adjusted < LEVEL)) return { word: 'no more than noise', symbol: 'x-thin-open' };
    const part = { symbol: 'circle-open' };
    if (d.verdict === 'too-little-data') return { word: 'cannot be judged yet', ...part };
    if (d.verdict === 'unexplained' && !tried(k)) return { word: 'possible: these poses cannot decide', ...part };
    return { word: k === d.candidates[0] ? 'explains part, but not in cross-validation' : 'explains part, less than the first', ...part };
  }

  /** What each candidate would leave. */
  function candidates(el, view) {
    const c = colours(el);
    const list = view.diagnosis.candidates;
    const small = narrow(el, 450);
    const cut = (name, most) => (name.length > most ? `${name.slice(0, most - 1)}…` : name);
    // two names that are cut alike are two rows all the same
    const y = list.map((k, i) => `${safe(cut(k.name, small ? 26 : 44))}${list.slice(0, i).some((o) => cut(o.name, small ? 26 : 44) === cut(k.name, small ? 26 : 44)) ? ` (${i + 1})` : ''}`);
    const traces = [
      { type: 'scatter', mode: 'markers', x: list.map((k) => k.rms_after_um), y, marker: { size: 12, symbol: list.map((k) => standing(view.diagnosis, k).symbol), color: OKABE.blue, line: { width: 2, color: OKABE.blue } }, name: 'remaining error', hovertemplate: '%{x:.2f} µm<extra>remaining</extra>' },
      { type: 'scatter', mode: 'markers', x: list.map((k) => (tried(k) ? k.held_out_after_um : null)), y, marker: { size: 12, symbol: 'diamond-open', color: OKABE.red, line: { width: 2 } }, name: 'cross-validated', hovertemplate: '%{x:.2f} µm<extra>cross-validated</extra>' },
    ];
    const top = Math.max(view.diagnosis.rms_um, ...list.flatMap((k) => [k.rms_after_um, k.held_out_after_um ?? 0]));
    const above = view.diagnosis.rms_um >= view.errors.noise_um;
    const line = (x, dash) => ({ type: 'line', x0: x, x1: x, y0: 0, y1: 1, yref: 'paper', line: { color: c.ink, width: 2, dash } });
    const lay = layout(el, {
      showlegend: true, legend: { orientation: 'h', y: small ? -0.42 : 1.12, yanchor: small ? 'top' : 'bottom', x: 0, ...(small ? { font: { size: 10 } } : {}) }, margin: { l: 8, r: 16, t: small ? 22 : 50, b: small ? 76 : 44 },
      xaxis: { title: { text: small ? 'RMS, µm' : 'remaining error (RMS), µm' }, range: [0, 1.12 * top], ...(small ? { nticks: 5 } : {}) }, yaxis: { autorange: 'reversed', ticks: '', ...(small ? { tickfont: { size: 10 } } : {}) },
      shapes: [line(view.diagnosis.rms_um, 'solid'), line(view.errors.noise_um, 'dash')],
      annotations: [
        // each on the side away from the other
        { x: view.diagnosis.rms_um, y: 1, yref: 'paper', yanchor: 'bottom', xanchor: above ? 'left' : 'right', showarrow: false, text: 'model now' },
        { x: view.errors.noise_um, y: 1, yref: 'paper', yanchor: 'bottom', xanchor: above ? 'right' : 'left', showarrow: false, text: 'noise' },
      ],
    });
    return draw(el, traces, lay, `Remaining error with each candidate: ${list.map((k) => `${k.name} ${digits(k.rms_after_um)} µm`).join(', ')}.`);
  }

  return { errors, parameters, ladder, residuals, machine, correlation, candidates, standing, tried, digits, valued, source, about, column, rungName, DIRECTION, JUDGEMENTS, OKABE };
})();
