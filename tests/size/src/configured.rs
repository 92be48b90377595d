//! Conditional compilation: whether an item is there.

use proc_macro2::{TokenStream, TokenTree};
use syn::{Attribute, Meta};

/// For which build a source is read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Build<'a> {
    /// True for the build of the tests.
    pub test: bool,
    /// Enabled features; `None` for all of them.
    pub features: Option<&'a [String]>,
}

/// The condition of an item.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Condition {
    Test,
    Feature(String),
    Not(Box<Self>),
    All(Vec<Self>),
    Any(Vec<Self>),
    /// Of the target: taken as true.
    Other,
}

impl Condition {
    /// The condition that an item's attributes state; `None` if they state none.
    pub(crate) fn read(attributes: &[Attribute]) -> Option<Self> {
        let conditions = attributes.iter().filter_map(|attribute| {
            let path = attribute.path();
            if path.is_ident("test") {
                return Some(Self::Test);
            }
            match &attribute.meta {
                Meta::List(list) if path.is_ident("cfg") => one(list.tokens.clone()),
                _ => None,
            }
        });
        let conditions: Vec<Self> = conditions.collect();
        (!conditions.is_empty()).then_some(Self::All(conditions))
    }

    /// True if the item is part of a build.
    pub(crate) fn holds(&self, build: Build<'_>) -> bool {
        match self {
            Self::Test => build.test,
            Self::Feature(name) => build.features.is_none_or(|all| all.contains(name)),
            Self::Not(of) => !of.holds(build),
            Self::All(of) => of.iter().all(|one| one.holds(build)),
            Self::Any(of) => of.iter().any(|one| one.holds(build)),
            Self::Other => true,
        }
    }
}

fn one(tokens: TokenStream) -> Option<Condition> {
    list(tokens).into_iter().next()
}

/// Conditions that are separated by commas.
fn list(tokens: TokenStream) -> Vec<Condition> {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let is_comma = |token: &TokenTree| matches!(token, TokenTree::Punct(p) if p.as_char() == ',');
    let parts = tokens.split(is_comma).filter(|part| !part.is_empty());
    parts.map(condition).collect()
}

fn condition(tokens: &[TokenTree]) -> Condition {
    match tokens {
        [TokenTree::Ident(name)] if name == "test" => Condition::Test,
        [TokenTree::Ident(name), _, TokenTree::Literal(value)] if name == "feature" => {
            Condition::Feature(value.to_string().trim_matches('"').to_owned())
        }
        [TokenTree::Ident(name), TokenTree::Group(group)] => {
            let inner = list(group.stream());
            match name.to_string().as_str() {
                "not" => Condition::Not(Box::new(Condition::All(inner))),
                "any" => Condition::Any(inner),
                _ => Condition::All(inner),
            }
        }
        _ => Condition::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holds(attribute: &str, test: bool, features: Option<&[String]>) -> bool {
        let item = format!("{attribute} fn f() {{}}");
        let item: syn::ItemFn = syn::parse_str(&item).unwrap();
        let condition = Condition::read(&item.attrs).unwrap();
        condition.holds(Build { test, features })
    }

    #[test]
    fn conditions_hold_for_a_build() {
        let solver = ["solver".to_owned()];
        assert!(!holds("#[test]", false, None));
        assert!(holds("#[cfg(all(test, unix))]", true, None));
        assert!(!holds("#[cfg(all(test, unix))]", false, None));
        let feature = "#[cfg(feature = \"solver\")]";
        assert!(holds(feature, false, None));
        assert!(holds(feature, false, Some(&solver)));
        assert!(!holds(feature, false, Some(&[])));
        let any = "#[cfg(any(test, feature = \"solver\"))]";
        assert!(holds(any, false, Some(&solver)) && !holds(any, false, Some(&[])));
        assert!(holds("#[cfg(not(test))]", false, Some(&[])));
    }
}
