// Parses the text of an explanation into terms and their texts.

const TERMS: Record<string, string> = { meaning: 'Meaning', cause: 'Cause', do: 'What to do', next: 'Command' };

export function explained(text: string): { head: string; rows: { term: string; text: string }[] } {
  const rows: { term: string; text: string }[] = [];
  const head: string[] = [];
  for (const line of text.split('\n')) {
    const found = /^\s*([a-z]+):\s+(.*)$/.exec(line);
    const term = found?.[1] === undefined ? undefined : TERMS[found[1]];
    const last = rows.at(-1);
    if (term) rows.push({ term, text: found?.[2] ?? '' });
    else if (last && line.trim()) last.text += ` ${line.trim()}`;
    else if (line.trim()) head.push(line.trim());
  }
  return { head: head.join(' '), rows };
}
