// The tones of what is shown; words say the same.

/** A state's colour and shape; each shape is another one, for those who do not see colours. */
export type Tone = 'off' | 'hold' | 'move' | 'pause' | 'teach' | 'error' | 'lost';

/** What an event is. */
export type EventTone = 'info' | 'good' | 'warn' | 'error';
