//! Keys of a file that its form does not have: all of them at once. The reader stops at the first.

use crate::diag::{Failure, Finding, Source, from_toml};
use serde::de::{DeserializeOwned, Deserializer, Visitor};
use std::fmt;
use toml::de::DeTable;

/// A text that is not of the form `T`: what the reader says, or, where that is about a key of the file's top level, the same of every key
/// there that the form does not have.
#[must_use]
pub fn not_of_form<T: DeserializeOwned>(
    error: &toml::de::Error,
    source: &Source,
    code: &'static str,
    help: &str,
) -> Failure {
    let known = fields_of::<T>();
    let table = DeTable::parse(source.inner()).ok();
    let keys = table.iter().flat_map(|table| table.get_ref().keys());
    let mut unknown: Vec<_> = keys.filter(|key| !known.contains(&&**key.get_ref())).collect();
    unknown.sort_by_key(|key| key.span().start);
    if !unknown.iter().any(|key| Some(key.span()) == error.span()) {
        return from_toml(error, source, code).help(help).into();
    }
    let expected = known.join("`, `");
    let finding = |key: &toml::Spanned<toml::de::DeString<'_>>| {
        let message = format!("unknown field `{}`, expected one of `{expected}`", key.get_ref());
        Finding::error(code, message).help(help).at(source, key.span())
    };
    Failure(unknown.into_iter().map(finding).collect())
}

/// The names of the fields of a record.
fn fields_of<T: DeserializeOwned>() -> &'static [&'static str] {
    T::deserialize(Asked).err().map_or(&[], |fields| fields.0)
}

/// A reader without a text: it only listens to what the record asks for.
struct Asked;

/// The fields that a record asked for.
#[derive(Debug)]
struct Fields(&'static [&'static str]);

impl fmt::Display for Fields {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.join(", "))
    }
}

impl std::error::Error for Fields {}

impl serde::de::Error for Fields {
    fn custom<M: fmt::Display>(_: M) -> Self {
        Self(&[])
    }
}

impl<'de> Deserializer<'de> for Asked {
    type Error = Fields;

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Fields> {
        Err(Fields(&[]))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        _: V,
    ) -> Result<V::Value, Fields> {
        Err(Fields(fields))
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct newtype_struct
        seq tuple tuple_struct map enum identifier ignored_any
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Form {
        one: f64,
        inner: Option<Inner>,
    }

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Inner {
        two: f64,
    }

    #[test]
    fn every_unknown_key_is_named_with_its_place() {
        let places = |text: &str| {
            let src = source("f.toml", text);
            let error = toml::from_str::<Form>(text).unwrap_err();
            let Failure(findings) = not_of_form::<Form>(&error, &src, "t::t", "what to do");
            assert!(findings.iter().all(|f| f.code == "t::t" && f.help.is_some()));
            findings.iter().map(|f| f.place().unwrap()).collect::<Vec<_>>()
        };
        assert_eq!(places("a = 1\none = 2\nb = 3\n"), ["f.toml:1:1", "f.toml:3:1"]);
        // what the reader found first is something else
        assert_eq!(places("one = \"x\"\nb = 3\n").len(), 1);
        assert_eq!(places("one = 1\n[inner]\nc = 1\n"), ["f.toml:3:1"]);
        assert_eq!(places("one = \n").len(), 1);
    }
}
