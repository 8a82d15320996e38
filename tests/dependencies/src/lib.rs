//! Nothing: the manifest is what is wanted of this package.
