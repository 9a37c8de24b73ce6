// Elements of the panel. Every control has a label that says what it does.

export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  const { dataset, ...rest } = properties;
  Object.assign(element, rest);
  Object.assign(element.dataset, dataset);
  element.append(...children);
  return element;
}

let numbered = 0;

function labelled(text, control, row = 'row') {
  control.id ||= `control-${++numbered}`;
  return make('div', { className: row }, make('label', { htmlFor: control.id, textContent: text }), control);
}

export function select(text, choices, value, change) {
  const control = make('select', { onchange: () => change(control.value) });
  const fill = (list, chosen) => {
    control.replaceChildren(...list.map(([key, name]) => make('option', { value: key, textContent: name })));
    control.value = chosen;
  };
  fill(choices, value);
  return { row: labelled(text, control), control, fill };
}

export function check(text, value, change) {
  const control = make('input', { type: 'checkbox', checked: value, onchange: () => change(control.checked) });
  control.id = `control-${++numbered}`;
  return { row: make('div', { className: 'check' }, control, make('label', { htmlFor: control.id, textContent: text })), control };
}

export function slider(text, { min, max, step, value, show = String }, change) {
  const control = make('input', { type: 'range', min, max, step });
  control.value = value;
  const said = make('output', { textContent: show(value) });
  const refresh = () => {
    said.textContent = show(Number(control.value));
    control.setAttribute('aria-valuetext', said.textContent);
  };
  control.oninput = () => {
    refresh();
    change(Number(control.value));
  };
  const row = labelled(text, control, 'row slider');
  row.append(said);
  refresh();
  return { row, control, refresh };
}

/** Buttons of which one is pressed. */
export function choice(text, choices, value, change) {
  const row = make('div', { className: 'row' }, make('span', { className: 'name', textContent: text }));
  const group = make('div', { className: 'choice', role: 'radiogroup', ariaLabel: text });
  const buttons = new Map();
  const set = (key) => {
    for (const [name, button] of buttons) {
      button.setAttribute('aria-checked', String(name === key));
      button.tabIndex = name === key ? 0 : -1;
    }
  };
  const keys = choices.map(([key]) => key);
  for (const [key, name] of choices) {
    const button = make('button', { type: 'button', textContent: name, onclick: () => (set(key), change(key)) });
    button.setAttribute('role', 'radio');
    button.onkeydown = (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.code];
      if (!step) return;
      const next = keys[(keys.indexOf(key) + step + keys.length) % keys.length];
      buttons.get(next).click();
      buttons.get(next).focus();
    };
    buttons.set(key, button);
    group.append(button);
  }
  set(value);
  row.append(group);
  return { row, set };
}

export function button(text, title, click) {
  return make('button', { type: 'button', textContent: text, title, onclick: click });
}

export function section(title, ...rows) {
  return make('section', {}, make('h2', { textContent: title }), ...rows);
}
