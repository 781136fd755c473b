//! Enums whose variants have a word each: the same in plant files, SQL, CSV and on screen.

/// What [`keyword_enum!`] makes: variants that are read from a file by their word.
pub(crate) trait Keyword: Copy + 'static {
    /// What the words name, for messages: `priority`.
    const WHAT: &'static str;
    /// Every variant with its word, in order.
    const WORDS: &'static [(&'static str, Self)];

    /// The variant of a word.
    fn from_word(word: &str) -> Option<Self> {
        Self::WORDS.iter().find(|(known, _)| *known == word).map(|(_, variant)| *variant)
    }
}

/// Defines an enum together with the word of each variant: `Low => "low"`.
macro_rules! keyword_enum {
    ($(#[$doc:meta])* $vis:vis enum $name:ident: $what:literal {
        $($(#[$note:meta])* $variant:ident $(= $number:literal)? => $word:literal,)*
    }) => {
        $(#[$doc])*
        $vis enum $name {
            $($(#[$note])* $variant $(= $number)?,)*
        }

        #[allow(dead_code, reason = "not every enum is listed, and some are only read")]
        impl $name {
            /// Every variant, in order.
            pub const ALL: [$name; [$($word),*].len()] = [$($name::$variant),*];

            /// Its word in files and on screen.
            pub fn word(self) -> &'static str {
                match self {
                    $($name::$variant => $word,)*
                }
            }
        }

        impl $crate::plant::keyword::Keyword for $name {
            const WHAT: &'static str = $what;
            const WORDS: &'static [(&'static str, Self)] = &[$(($word, $name::$variant)),*];
        }
    };
}
pub(crate) use keyword_enum;
