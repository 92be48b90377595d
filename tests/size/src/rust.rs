//! What a Rust source holds, with its lines.

use std::ops::Range;

use proc_macro2::{Span, TokenStream, TokenTree};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{
    Attribute, Block, Expr, ExprLit, FnArg, Ident, ImplItemFn, Item, ItemFn, Lit, Meta, Pat,
    Signature, TraitItemFn, Type, UseTree, Visibility,
};

use crate::configured::{Build, Condition};

/// The comment above a function that only fills a value.
const CONSTRUCTOR: &str = "// A straight constructor";

/// A function with a body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Function {
    /// Its name.
    pub name: String,
    /// Its line, from 1.
    pub line: usize,
    /// Lines from the word `fn` to the closing brace.
    pub lines: usize,
    /// True if a comment calls it a straight constructor.
    pub is_constructor: bool,
}

/// A parameter of a function that is a tuple or an array.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parameter {
    /// Line of the function, from 1.
    pub line: usize,
    /// The function's name.
    pub function: String,
    /// As it is written.
    pub text: String,
}

/// The name of a type or trait where it is defined.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TypeName {
    /// Its line, from 1.
    pub line: usize,
    /// The name.
    pub name: String,
}

/// A path that begins at the crate or at a module above, or what is shown to others.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Import {
    /// Its line, from 1.
    pub line: usize,
    /// The modules inside this file that it stands in.
    pub inside: Vec<String>,
    /// Its segments: `crate`, `room`, `Name`.
    pub path: Vec<String>,
    /// True for `pub use`.
    pub is_public: bool,
}

/// Text that a user reads as help.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Text {
    /// Its first line, from 1.
    pub line: usize,
    /// The text.
    pub text: String,
}

/// A module in a file of its own.
#[derive(Debug, Clone)]
pub(crate) struct ModuleFile {
    pub name: String,
    /// What `#[path]` says.
    pub path: Option<String>,
    pub condition: Option<Condition>,
}

/// What a source holds.
#[derive(Debug, Clone, Default)]
pub struct Rust {
    /// Functions with a body, nested ones too.
    pub functions: Vec<Function>,
    /// Parameters that are tuples or arrays of several equal primitive types.
    pub parameters: Vec<Parameter>,
    /// Types and traits.
    pub types: Vec<TypeName>,
    /// Paths within the crate, but for those of tests.
    pub imports: Vec<Import>,
    /// Help of commands and options.
    pub help: Vec<Text>,
    /// Lines with code, from 0.
    pub(crate) code_lines: Vec<bool>,
    /// The text with comments and literals blanked, line by line.
    pub(crate) masked: String,
    /// Ranges of lines, from 0, that are there on a condition.
    pub(crate) conditions: Vec<(Range<usize>, Condition)>,
    pub(crate) modules: Vec<ModuleFile>,
}

impl Rust {
    /// Reads a source.
    ///
    /// # Errors
    /// What is no Rust.
    pub fn read(text: &str) -> syn::Result<Self> {
        let file = syn::parse_file(text)?;
        let tokens: TokenStream = text.parse()?;
        let lines: Vec<&str> = text.lines().collect();
        let mut reader = Reader {
            found: Self {
                code_lines: vec![false; lines.len()],
                masked: masked(text, tokens.clone()),
                ..Self::default()
            },
            lines: &lines,
            inside: Vec::new(),
            tests: 0,
        };
        reader.mark(text, tokens);
        if let Some(condition) = Condition::read(&file.attrs) {
            reader.found.conditions.push((0..lines.len(), condition));
        }
        reader.visit_file(&file);
        Ok(reader.found)
    }
}

/// True for a token that is a doc comment: its span is the comment's.
fn is_comment(text: &str, span: Span) -> bool {
    let source = &text[span.byte_range()];
    source.starts_with("//") || source.starts_with("/*")
}

/// `text` with everything but code blanked; of literals only quotes and numbers are kept.
fn masked(text: &str, tokens: TokenStream) -> String {
    let blank = |byte: &u8| if *byte == b'\n' { b'\n' } else { b' ' };
    let mut out: Vec<u8> = text.as_bytes().iter().map(blank).collect();
    keep(text, tokens, &mut out);
    String::from_utf8_lossy(&out).into_owned()
}

fn keep(text: &str, tokens: TokenStream, out: &mut [u8]) {
    for token in tokens
        .into_iter()
        .filter(|token| !is_comment(text, token.span()))
    {
        let range = token.span().byte_range();
        let mut copy = |range: Range<usize>| {
            out[range.clone()].copy_from_slice(&text.as_bytes()[range]);
        };
        match token {
            TokenTree::Group(group) => {
                copy(group.span_open().byte_range());
                copy(group.span_close().byte_range());
                keep(text, group.stream(), out);
            }
            TokenTree::Literal(_) if text[range.clone()].contains(['"', '\'']) => {
                copy(range.end - 1..range.end);
            }
            _ => copy(range),
        }
    }
}

struct Reader<'a> {
    found: Rust,
    lines: &'a [&'a str],
    /// Names of the modules that are being read.
    inside: Vec<String>,
    /// Items around that belong to tests.
    tests: usize,
}

impl Reader<'_> {
    /// Marks the lines of the tokens.
    fn mark(&mut self, text: &str, tokens: TokenStream) {
        for token in tokens {
            if is_comment(text, token.span()) {
                continue;
            }
            match token {
                TokenTree::Group(group) => {
                    self.mark_span(group.span_open());
                    self.mark_span(group.span_close());
                    self.mark(text, group.stream());
                }
                _ => self.mark_span(token.span()),
            }
        }
    }

    fn mark_span(&mut self, span: Span) {
        self.found.code_lines[span.start().line - 1..span.end().line].fill(true);
    }

    /// Reads what an item or a statement guards; `visit` goes into it.
    fn guarded(&mut self, attributes: &[Attribute], span: Span, visit: impl FnOnce(&mut Self)) {
        let Some(condition) = Condition::read(attributes) else {
            return visit(self);
        };
        let first = attributes
            .iter()
            .map(|attribute| attribute.span().start().line)
            .min();
        let first = first.unwrap_or(span.start().line).min(span.start().line);
        let is_test = !condition.holds(Build {
            test: false,
            features: None,
        });
        self.found
            .conditions
            .push((first - 1..span.end().line, condition));
        self.tests += usize::from(is_test);
        visit(self);
        self.tests -= usize::from(is_test);
    }

    fn function(&mut self, signature: &Signature, block: &Block) {
        let line = signature.fn_token.span().start().line;
        let above = self.lines[..line - 1].iter().rev();
        let mut above = above.take_while(|line| line.trim_start().starts_with(['/', '#']));
        let name = signature.ident.to_string();
        for input in &signature.inputs {
            if let FnArg::Typed(input) = input
                && is_unlike(&input.pat, &input.ty)
                && self.tests == 0
            {
                let text = input.span().source_text().unwrap_or_default();
                let function = name.clone();
                self.found.parameters.push(Parameter {
                    line,
                    function,
                    text,
                });
            }
        }
        self.found.functions.push(Function {
            name,
            line,
            lines: block.span().end().line + 1 - line,
            is_constructor: above.any(|line| line.contains(CONSTRUCTOR)),
        });
    }

    fn type_name(&mut self, name: &Ident) {
        let line = name.span().start().line;
        self.found.types.push(TypeName {
            line,
            name: name.to_string(),
        });
    }

    /// The docs of a command, its options and values.
    fn help(&mut self, attributes: &[Attribute], inner: Vec<&[Attribute]>) {
        let is_help = |attribute: &Attribute| match &attribute.meta {
            Meta::List(list) if attribute.path().is_ident("derive") => {
                let derived = list.tokens.to_string();
                ["Parser", "Args", "Subcommand", "ValueEnum"]
                    .iter()
                    .any(|d| derived.contains(d))
            }
            _ => false,
        };
        if attributes.iter().any(is_help) {
            let all = [attributes].into_iter().chain(inner);
            self.found.help.extend(all.filter_map(documentation));
        }
    }

    fn import(&mut self, line: usize, path: Vec<String>, is_public: bool) {
        let first = path.first().map(String::as_str);
        let is_local = matches!(first, Some("crate" | "super" | "self"));
        if (is_local || is_public) && self.tests == 0 {
            let inside = self.inside.clone();
            self.found.imports.push(Import {
                line,
                inside,
                path,
                is_public,
            });
        }
    }

    fn use_tree(&mut self, tree: &UseTree, path: &mut Vec<String>, is_public: bool) {
        let line = tree.span().start().line;
        match tree {
            UseTree::Path(of) => {
                path.push(of.ident.to_string());
                self.use_tree(&of.tree, path, is_public);
                path.pop();
            }
            UseTree::Name(of) => {
                let path = [path.as_slice(), &[of.ident.to_string()]].concat();
                self.import(line, path, is_public);
            }
            UseTree::Rename(of) => {
                let path = [path.as_slice(), &[of.ident.to_string()]].concat();
                self.import(line, path, is_public);
            }
            UseTree::Glob(_) => self.import(line, path.clone(), is_public),
            UseTree::Group(of) => {
                for tree in &of.items {
                    self.use_tree(tree, path, is_public);
                }
            }
        }
    }
}

/// The doc comment among attributes.
fn documentation(attributes: &[Attribute]) -> Option<Text> {
    let lines = attributes
        .iter()
        .filter_map(|attribute| Some((attribute.span().start().line, string(attribute, "doc")?)));
    let lines: Vec<(usize, String)> = lines.collect();
    let text: Vec<&str> = lines.iter().map(|(_, text)| text.as_str()).collect();
    Some(Text {
        line: lines.first()?.0,
        text: text.join("\n"),
    })
}

const PRIMITIVES: [&str; 14] = [
    "f32", "f64", "u8", "u16", "u32", "u64", "u128", "usize", "i8", "i16", "i32", "i64", "isize",
    "bool",
];

/// True for a parameter whose values probably differ in meaning: a tuple with two equal primitive
/// types, or an array of a primitive type that is taken apart into different names.
fn is_unlike(pattern: &Pat, of: &Type) -> bool {
    let of = match of {
        Type::Reference(reference) => &*reference.elem,
        other => other,
    };
    let name = |of: &Type| match of {
        Type::Path(path) => path.path.get_ident().map(Ident::to_string),
        _ => None,
    };
    let is_primitive = |name: &String| PRIMITIVES.contains(&name.as_str());
    match (of, pattern) {
        (Type::Tuple(tuple), _) => {
            let mut names: Vec<String> = tuple.elems.iter().filter_map(name).collect();
            names.retain(is_primitive);
            names.sort_unstable();
            names.windows(2).any(|pair| pair[0] == pair[1])
        }
        (Type::Array(array), Pat::Slice(slice)) => {
            slice.elems.len() > 1 && name(&array.elem).is_some_and(|name| is_primitive(&name))
        }
        _ => false,
    }
}

impl<'ast> Visit<'ast> for Reader<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        let attributes = attributes(item);
        self.guarded(attributes, item.span(), |reader| {
            reader.take(item);
            visit::visit_item(reader, item);
            if matches!(item, Item::Mod(of) if of.content.is_some()) {
                reader.inside.pop();
            }
        });
    }

    fn visit_item_fn(&mut self, of: &'ast ItemFn) {
        self.function(&of.sig, &of.block);
        visit::visit_item_fn(self, of);
    }

    fn visit_impl_item_fn(&mut self, of: &'ast ImplItemFn) {
        self.guarded(&of.attrs, of.span(), |reader| {
            reader.function(&of.sig, &of.block);
            visit::visit_impl_item_fn(reader, of);
        });
    }

    fn visit_trait_item_fn(&mut self, of: &'ast TraitItemFn) {
        if let Some(block) = &of.default {
            self.function(&of.sig, block);
        }
        visit::visit_trait_item_fn(self, of);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let segments = path
            .segments
            .iter()
            .map(|segment| segment.ident.to_string());
        let segments: Vec<String> = segments.collect();
        if segments.len() > 1 {
            self.import(path.span().start().line, segments, false);
        }
        visit::visit_path(self, path);
    }
}

impl Reader<'_> {
    fn take(&mut self, item: &Item) {
        match item {
            Item::Mod(of) if of.content.is_some() => self.inside.push(of.ident.to_string()),
            Item::Mod(of) => self.found.modules.push(ModuleFile {
                name: of.ident.to_string(),
                path: of.attrs.iter().find_map(|one| string(one, "path")),
                condition: Condition::read(&of.attrs),
            }),
            Item::Use(of) => {
                let is_public = !matches!(of.vis, Visibility::Inherited);
                self.use_tree(&of.tree, &mut Vec::new(), is_public);
            }
            Item::Struct(of) => {
                self.type_name(&of.ident);
                let fields = of.fields.iter().map(|field| field.attrs.as_slice());
                self.help(&of.attrs, fields.collect());
            }
            Item::Enum(of) => {
                self.type_name(&of.ident);
                let variants = of.variants.iter().flat_map(|variant| {
                    let fields = variant.fields.iter().map(|field| field.attrs.as_slice());
                    [variant.attrs.as_slice()].into_iter().chain(fields)
                });
                self.help(&of.attrs, variants.collect());
            }
            Item::Trait(of) => self.type_name(&of.ident),
            Item::Type(of) => self.type_name(&of.ident),
            _ => {}
        }
    }
}

/// The string in `#[name = "string"]`.
fn string(attribute: &Attribute, name: &str) -> Option<String> {
    match &attribute.meta {
        Meta::NameValue(pair) if pair.path.is_ident(name) => match &pair.value {
            Expr::Lit(ExprLit {
                lit: Lit::Str(text),
                ..
            }) => Some(text.value()),
            _ => None,
        },
        _ => None,
    }
}

fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(of) => &of.attrs,
        Item::Enum(of) => &of.attrs,
        Item::Fn(of) => &of.attrs,
        Item::Impl(of) => &of.attrs,
        Item::Macro(of) => &of.attrs,
        Item::Mod(of) => &of.attrs,
        Item::Static(of) => &of.attrs,
        Item::Struct(of) => &of.attrs,
        Item::Trait(of) => &of.attrs,
        Item::Type(of) => &of.attrs,
        Item::Use(of) => &of.attrs,
        _ => &[],
    }
}
