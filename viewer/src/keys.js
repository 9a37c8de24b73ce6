// Keys, wherever the focus is but in a field.
export function bindKeys(viewer, panel) {
  const { controls, model } = viewer;
  const press = (control) => control?.control.isConnected && control.control.click();
  const from = (direction) => controls.home(direction.clone());
  const nextOf = (choice) => {
    const buttons = [...choice.row.querySelectorAll('button')];
    const at = buttons.findIndex((button) => button.getAttribute('aria-checked') === 'true');
    buttons[(at + 1) % buttons.length].click();
  };
  const show = (what) => [...panel.shows.control.options].some((option) => option.value === what) && panel.show(what);
  const resize = (step) => {
    if (!panel.points) return;
    panel.points.control.value = Number(panel.points.control.value) + step;
    panel.points.control.oninput();
  };
  const actions = {
    f: () => controls.home(),
    o: () => nextOf(panel.mode),
    c: () => show('colour'),
    n: () => show('normal'),
    g: () => model.kind !== 'points' && nextOf(panel.shading),
    l: () => press(panel.edges),
    b: () => press(panel.boundary),
    x: () => nextOf(panel.clip),
    m: () => viewer.setMeasuring(!viewer.measuring),
    p: () => viewer.savePicture(),
    t: () => nextOf(panel.theme),
    h: () => panel.toggle(),
    '?': () => panel.help.toggle(),
    '+': () => resize(0.25),
    '-': () => resize(-0.25),
    1: () => from(controls.frame().front),
    2: () => from(controls.frame().right),
    3: () => from(controls.frame().above.clone().addScaledVector(controls.frame().front, 1e-3)),
    Escape: () => viewer.measuring && viewer.setMeasuring(false),
  };
  window.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches('input[type="number"], select')) return;
    const action = actions[event.key] ?? actions[event.key.toLowerCase()];
    if (!action || (panel.help.dialog.open && event.key !== '?')) return;
    event.preventDefault();
    action();
  });
}
