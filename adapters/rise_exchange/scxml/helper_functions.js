// Our condition language as functions of ECMAScript, for the <script> of a document.
//
// Each implements a rule of docs/explanation/semantics.md: truth, equality, missing keys and parts (8.2, 8.4), the
// setting of parts (8.5), lists and chance (8.6), limits (8.7), and computed times (5.5). A missing key or part is
// undefined, which no value of a memory is. The functions use the document's data memory, seed, countdown and
// countdowns.

function key(name) {  // the value of a memory key; undefined: there is none
  if (has(memory, name)) return memory[name];
  const [head, ...names] = name.split('.');
  return names.reduce(inner, has(memory, head) && names.length ? memory[head] : undefined);
}

function has(object, name) {
  return Object.prototype.hasOwnProperty.call(object, name);
}

function isObject(value) {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}

function inner(holder, name) {  // what is named behind a dot
  if (Array.isArray(holder)) return /^[0-9]{1,9}$/.test(name) ? holder[Number(name)] : undefined;
  return isObject(holder) && has(holder, name) ? holder[name] : undefined;
}

function indexed(holder, index) {  // what an index in brackets means
  if (Array.isArray(holder)) return Number.isInteger(index) ? holder[index] : undefined;
  const name = nameOf(index);
  return isObject(holder) && name !== undefined && has(holder, name) ? holder[name] : undefined;
}

function nameOf(index) {
  if (typeof index === 'string') return index;
  return Number.isInteger(index) ? BigInt(index).toString() : undefined;
}

function missingPart() {
  const error = new Error('missing-part');
  error.isMissingPart = true;
  return error;
}

function part(value, ...steps) {  // a step is a function that gives an index, or a name behind a dot
  if (value === undefined) throw missingPart();
  return steps.reduce((holder, step) => {
    const found = typeof step === 'string' ? inner(holder, step) : indexed(holder, step());
    if (found === undefined) throw missingPart();
    return found;
  }, value);
}

function isThere(read) {  // defined(items[i])
  try {
    read();
    return true;
  } catch (error) {
    if (error.isMissingPart) return false;
    throw error;
  }
}

function named(name, constant) {  // a memory key hides the constant of its name
  return has(memory, name) ? memory[name] : constant;
}

function holds(condition) {  // an error makes a condition false
  try {
    return condition();
  } catch (error) {
    return false;
  }
}

function truth(value) {  // a number is true above 0, everything else when it is not empty
  if (typeof value === 'boolean') return value;
  if (typeof value === 'number') return value > 0;
  if (value === undefined || value === null) return false;
  return typeof value === 'string' ? value !== '' : Object.keys(value).length > 0;
}

function odd(...conditions) {
  return conditions.filter(Boolean).length % 2 === 1;
}

function number(value) {
  if (value === undefined) return 0;
  if (typeof value === 'number' || typeof value === 'boolean') return Number(value);
  throw new Error('this is no number');
}

function text(value) {
  if (value === undefined) return '';
  if (typeof value === 'string') return value;
  throw new Error('this is no text');
}

function sum(...values) {  // texts are joined, numbers added
  const known = values.filter(value => value !== undefined);
  if (known.some(value => typeof value === 'string')) return known.map(text).join('');
  return values.map(number).reduce((total, value) => total + value, 0);
}

function same(a, b) {  // equality crosses no types; what is not there equals null, false, 0 and ''
  if (a === undefined || b === undefined) {
    const other = a === undefined ? b : a;
    return [undefined, null, false, 0, ''].includes(other);
  }
  return alike(a, b);
}

function alike(a, b) {
  if (typeof a === 'boolean') a = Number(a);
  if (typeof b === 'boolean') b = Number(b);
  if (Array.isArray(a) && Array.isArray(b)) {
    return a.length === b.length && a.every((entry, index) => alike(entry, b[index]));
  }
  if (!isObject(a) || !isObject(b)) return a === b;
  const names = Object.keys(a);
  return names.length === Object.keys(b).length && names.every(name => has(b, name) && alike(a[name], b[name]));
}

function order(a, b) {  // below 0: a comes first; NaN when one of them is
  if (a === undefined) a = typeof b === 'string' ? '' : 0;
  if (b === undefined) b = typeof a === 'string' ? '' : 0;
  if (typeof a === 'boolean') a = Number(a);
  if (typeof b === 'boolean') b = Number(b);
  if (typeof a === 'number' && typeof b === 'number') return a < b ? -1 : a > b ? 1 : a === b ? 0 : NaN;
  if (typeof a !== 'string' || typeof b !== 'string') throw new Error('these cannot be ordered');
  const others = Array.from(b);
  for (const [index, character] of Array.from(a).entries()) {
    if (index >= others.length) return 1;
    if (character !== others[index]) return character.codePointAt(0) - others[index].codePointAt(0);
  }
  return a.length < b.length ? -1 : 0;
}

function contains(holder, piece) {
  if (holder === undefined) return piece === undefined || piece === '';
  if (piece === undefined) piece = '';
  if (Array.isArray(holder)) return holder.some(entry => same(entry, piece));
  if (typeof piece === 'string' && typeof holder === 'string') return holder.includes(piece);
  if (typeof piece === 'string' && isObject(holder)) return has(holder, piece);
  throw new Error('this contains nothing');
}

function lengthOf(value) {
  if (value === undefined) return 0;
  if (typeof value === 'string') return Array.from(value).length;
  if (typeof value === 'object' && value !== null) return Object.keys(value).length;
  throw new Error('this has no length');
}

function power(a, b) {  // as IEEE 754 has it, where ECMAScript gives NaN
  if (a === 1 || (a === -1 && Math.abs(b) === Infinity)) return 1;
  return Math.pow(a, b);
}

function floor(x) {
  return Math.floor(x) + 0;
}

function ceil(x) {
  return Math.ceil(x) + 0;
}

function round(x) {  // half to even
  if (!Number.isFinite(x)) return x;
  const size = Math.abs(x), units = Math.floor(size), rest = size - units;
  return Math.sign(x) * (rest > 0.5 || (rest === 0.5 && units % 2 === 1) ? units + 1 : units) + 0;
}

function least(...numbers) {
  return numbers.some(Number.isNaN) ? NaN : numbers.reduce((a, b) => b < a ? b : a);
}

function most(...numbers) {
  return numbers.some(Number.isNaN) ? NaN : numbers.reduce((a, b) => b > a ? b : a);
}

function lerp(a, b, t) {
  return a + (b - a) * t;
}

function clamp(x, low, high) {
  return x < low ? low : x > high ? high : x;
}

function draw() {  // SplitMix64; the state is kept as a text
  const mask = BigInt('0xFFFFFFFFFFFFFFFF');
  const state = (BigInt(seed) + BigInt('0x9E3779B97F4A7C15')) & mask;
  seed = String(state);
  let z = state;
  z = ((z ^ (z >> BigInt(30))) * BigInt('0xBF58476D1CE4E5B9')) & mask;
  z = ((z ^ (z >> BigInt(27))) * BigInt('0x94D049BB133111EB')) & mask;
  return z ^ (z >> BigInt(31));
}

function below(count) {
  return Number((draw() * BigInt(count)) >> BigInt(64));
}

function rand(...bounds) {
  const [low, high] = [0, ...bounds].slice(-2);
  return low + Number(draw() >> BigInt(11)) / 9007199254740992 * (high - low);
}

function list(value) {
  if (value === undefined) return [];
  if (!Array.isArray(value) || value.length > 10000) throw new Error('this is no list of at most 10,000 entries');
  return value;
}

function whole(value, lowest) {
  if (!Number.isInteger(value) || Math.abs(value) > 9007199254740992 || value < lowest) {
    throw new Error('this is no whole number that can stand here');
  }
  return value;
}

function range(...numbers) {
  const [first, end] = [0, ...numbers].slice(-2).map(value => whole(value, -Infinity));
  return list(Array.from({length: Math.min(Math.max(0, end - first), 10001)}, (_, index) => first + index));
}

function shuffle(value) {
  const result = list(value).slice();
  for (let last = result.length - 1; last > 0; last--) {
    const picked = below(last + 1);
    [result[last], result[picked]] = [result[picked], result[last]];
  }
  return result;
}

function sample(value, count) {
  const rest = list(value).slice();
  if (whole(count, 0) > rest.length) throw new Error('there are not so many entries');
  const result = [];
  while (result.length < count) {
    const picked = below(rest.length);
    result.push(rest[picked]);
    rest[picked] = rest[rest.length - 1];
    rest.pop();
  }
  return result;
}

function latin(value, row) {
  const entries = list(value), size = entries.length;
  whole(row, 0);
  const result = entries.map((_, place) => {
    const shift = place % 2 === 0 ? -place / 2 : (place + 1) / 2;
    return entries[(row % size + shift + size) % size];
  });
  return size % 2 === 1 && (row - row % size) / size % 2 === 1 ? result.reverse() : result;
}

function kept(value) {  // a value as the memory keeps it
  if (value === undefined) return null;
  if (typeof value === 'number' && !Number.isFinite(value)) throw new Error('the memory cannot hold this');
  return value === 0 ? 0 : value;
}

function levels(value) {
  if (typeof value !== 'object' || value === null) return 0;
  return 1 + Object.values(value).reduce((deepest, entry) => Math.max(deepest, levels(entry)), 0);
}

function withName(object, name, value) {
  return Object.fromEntries([...Object.entries(object), [name, value]]);
}

function within(holder, [step, ...rest], value, makes) {  // a copy with a part set
  const index = typeof step === 'string' ? step : step();
  const found = typeof step === 'string' ? inner(holder, step) : indexed(holder, index);
  const place = Array.isArray(holder) ? Number(index) : nameOf(index);
  if (found === undefined && (!isObject(holder) || place === undefined || (rest.length && !makes))) {
    throw missingPart();
  }
  const deeper = found === undefined ? {} : found;
  if (rest.length && (typeof deeper !== 'object' || deeper === null)) throw missingPart();
  const set = rest.length ? within(deeper, rest, value, makes) : value;
  if (!Array.isArray(holder)) return withName(holder, place, set);
  const copy = holder.slice();
  copy[place] = set;
  return copy;
}

function changed(name, value) {  // the memory with a key set, or a part that its dots name
  const [head, ...names] = name.split('.');
  const holder = has(memory, head) ? memory[head] : undefined;
  if (has(memory, name) || !names.length || typeof holder !== 'object' || holder === null) {
    return withName(memory, name, value);
  }
  if (names.length + levels(value) > 64) throw new Error('this would be nested too deeply');
  return withName(memory, head, within(holder, names, value, true));
}

function changedPart(name, value, ...steps) {  // the memory with a part set that an index names
  if (key(name) === undefined) throw missingPart();
  const [head, ...names] = has(memory, name) ? [name] : name.split('.');
  const result = withName(memory, head, within(memory[head], [...names, ...steps], value, false));
  if (names.length + steps.length + levels(value) > 64) throw new Error('this would be nested too deeply');
  return result;
}

function limited(result) {  // at most 100,000 bytes as JSON, of lists and objects
  for (const [name, value] of Object.entries(result)) {
    if (typeof value !== 'object' || value === null || (has(memory, name) && value === memory[name])) continue;
    const bytes = Array.from(JSON.stringify(value)).reduce((sum, character) => {
      const point = character.codePointAt(0);
      return sum + (point < 128 ? 1 : point < 2048 ? 2 : point < 65536 ? 3 : 4);
    }, 0);
    if (bytes > 100000) throw new Error('this is too long');
  }
  return result;
}

function wordOrKey(name) {  // a bare word is a text when it is no key
  const value = key(name);
  return value === undefined ? name : value;
}

function changedKey(name) {  // the key whose value has the part in it that was set
  return has(memory, name) ? name : name.split('.')[0];
}

function noted(event) {  // memory.KEY is set, forgotten.KEY is gone
  const [kind, ...names] = event.name.split('.');
  const name = names.join('.').replace(/_x([0-9A-F]+)_/g, (_, code) => String.fromCodePoint(parseInt(code, 16)));
  if (kind === 'memory') return withName(memory, name, event.data === undefined ? null : event.data);
  return Object.fromEntries(Object.entries(memory).filter(entry => entry[0] !== name));
}

function begin(index) {  // numbers a countdown, so that an earlier one of the same name does not count
  countdown += 1;
  countdowns[index] = countdown;
  return countdown;
}

function computedDelay(compute, unit) {  // as SCXML writes it; '' when it is no time
  let value;
  try {
    value = compute();
  } catch (error) {
    return '';
  }
  let seconds;
  if (typeof value === 'number') {
    seconds = Math.abs(value) < 1e15 ? value * (unit || 1) : value > 0 ? Infinity : 0;
  } else {
    const found = /^[ \t\n\r\f\v]*([0-9]+(?:\.[0-9]+)?)[ \t\n\r\f\v]*(ms|s|min)[ \t\n\r\f\v]*$/.exec(value);
    if (typeof value !== 'string' || unit || !found) return '';
    seconds = Number(found[1]) * {ms: 0.001, s: 1, min: 60}[found[2]];
  }
  return seconds > 86400 ? '' : `${milliseconds(Math.max(seconds, 0.001))}ms`;
}

function milliseconds(seconds) {  // of whole microseconds, half to even
  const [, units, digits, rest] = /^([0-9]+)\.([0-9]{6})([0-9]*)$/.exec(seconds.toFixed(70));
  const up = /^5/.test(rest) && (/[1-9]/.test(rest.slice(1)) || Number(digits) % 2 === 1) || /^[6-9]/.test(rest);
  return (Number(units + digits) + (up ? 1 : 0)) / 1000;
}
