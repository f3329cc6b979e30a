// Available width of the page.

const query = matchMedia('(min-width: 1000px)');

/**
 * `wide`: the state is shown next to the commands, otherwise above them. The limit is the same as in the style sheets.
 */
export const room = $state({ wide: query.matches });

query.addEventListener('change', () => (room.wide = query.matches));
