//! Elements of the document: children by name, text, places.

use crate::parse_error::{ParseError, Position};

/// An element.
#[derive(Clone, Copy)]
pub(super) struct Element<'a> {
    node: roxmltree::Node<'a, 'a>,
}

impl<'a> Element<'a> {
    pub(super) const fn new(node: roxmltree::Node<'a, 'a>) -> Self {
        Self { node }
    }

    /// Its name without a namespace.
    pub(super) fn name(self) -> &'a str {
        self.node.tag_name().name()
    }

    /// Where it begins. Takes as long as the text before it is.
    pub(super) fn at(self) -> Position {
        let at = self.node.document().text_pos_at(self.node.range().start);
        Position {
            line: at.row as usize,
            column: at.col as usize,
        }
    }

    pub(super) fn wrong(self, message: impl Into<String>) -> ParseError {
        ParseError::new(self.at(), message)
    }

    pub(super) fn children(self) -> impl Iterator<Item = Element<'a>> {
        let all = self.node.children();
        all.filter(roxmltree::Node::is_element).map(Element::new)
    }

    pub(super) fn named(self, name: &str) -> impl Iterator<Item = Element<'a>> {
        self.children().filter(move |child| child.name() == name)
    }

    pub(super) fn optional(self, name: &str) -> Option<Element<'a>> {
        self.named(name).next()
    }

    pub(super) fn child(self, name: &str) -> Result<Element<'a>, ParseError> {
        self.optional(name)
            .ok_or_else(|| self.wrong(format!("<{}> without <{name}>", self.name())))
    }

    /// Its text; comments in between are passed over.
    pub(super) fn text(self) -> String {
        let pieces = self
            .node
            .children()
            .filter(roxmltree::Node::is_text)
            .filter_map(|child| child.text());
        pieces.collect()
    }

    pub(super) fn attribute(self, name: &str) -> Option<&'a str> {
        self.node.attribute(name)
    }

    pub(super) fn needed_attribute(self, name: &str) -> Result<&'a str, ParseError> {
        self.attribute(name)
            .ok_or_else(|| self.wrong(format!("<{}> without {name}=\"...\"", self.name())))
    }
}

/// The beginning of a text, for messages.
pub(super) fn short(text: &str) -> &str {
    let end = text.char_indices().nth(40).map_or(text.len(), |(at, _)| at);
    &text[..end]
}
