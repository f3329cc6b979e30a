// Tones of displayed states; the text has the same meaning.

/** A state's colour and shape; each shape is different, for users who do not see colours. */
export type Tone = 'off' | 'hold' | 'move' | 'pause' | 'teach' | 'error' | 'lost';

/** Tone of an event. */
export type EventTone = 'info' | 'good' | 'warn' | 'error';
