//! From the rows of the [`super::table`] to the types that files and code name layers by.

/// Makes [`LayerSpec`], what files may write of it, and its [`Layer`]s out of the table.
macro_rules! layers {
    (
        files name {$(
            $(#[$doc:meta])*
            $named:ident $({ $($(#[$option_doc:meta])* $option:ident: $kind:ty),* })?
                = $key:literal: $row:expr, |$seen:ident, $out:ident| $fill:expr;
        )*}
        no file names {$(
            $(#[$own_doc:meta])*
            $own:ident $({ $($(#[$own_option_doc:meta])* $own_option:ident: $own_kind:ty),* })?:
                $own_row:expr, |$own_seen:ident, $own_out:ident| $own_fill:expr;
        )*}
    ) => {
        /// A layer as the scene file writes it: a name (`"depth"`), or an object with a `type` and
        /// options (`{"type": "normal", "space": "camera"}`).
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
        #[serde(tag = "type", rename_all = "snake_case")]
        pub enum LayerSpec {
            $($(#[$doc])* $named $({ $($(#[$option_doc])* $option: $kind),* })?,)*
            $($(#[$own_doc])* $own $({ $($(#[$own_option_doc])* $own_option: $own_kind),* })?,)*
        }

        /// The same, with every option optional and unknown keys refused: what is read.
        #[derive(Deserialize, schemars::JsonSchema)]
        #[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
        pub(super) enum LayerInput {
            $($named { $($(#[serde(default)] $option: $kind),*)? },)*
        }

        impl From<LayerInput> for LayerSpec {
            fn from(written: LayerInput) -> Self {
                match written {
                    $(LayerInput::$named { $($($option),*)? } =>
                        Self::$named $({ $($option),* })?,)*
                }
            }
        }

        impl LayerSpec {
            /// Every layer by its plain name, in the order that help texts list them.
            pub const NAMES: [&'static str; [$($key),*].len()] = [$($key),*];

            /// The layer of this plain name, with default options.
            #[must_use]
            pub fn from_name(name: &str) -> Option<Self> {
                Some(match name {
                    $($key => Self::$named $({ $($option: <$kind>::default()),* })?,)*
                    _ => return None,
                })
            }

            /// Row of the layer: what is known of it without rendering it.
            #[must_use]
            pub fn row(self) -> Layer {
                match self {
                    $(Self::$named $({ $($option),* })? => $row,)*
                    $(Self::$own $({ $($own_option),* })? => $own_row,)*
                }
            }

            /// Refills the first columns with the layer's channels, a number for each ray. A layer
            /// that is averaged refills three.
            pub fn fill(self, seen: &LayerContext<'_>, out: &mut Columns) {
                match self {
                    $(Self::$named $({ $($option),* })? => {
                        let ($seen, $out) = (seen, out);
                        $fill
                    })*
                    $(Self::$own $({ $($own_option: _),* })? => {
                        let ($own_seen, $own_out) = (seen, out);
                        $own_fill
                    })*
                }
            }
        }
    };
}

pub(super) use layers;
