//! The page around the sections: one file, no script, nothing loaded.

use crate::colour::{Colour, variables};
pub use crate::markup::escaped;
use crate::stroke::Stroke;

/// Style of the page; colours for light and dark, to which those of faults come.
const STYLE: &str = "\
:root{color-scheme:light dark;--back:#fcfcfb;--ink:#1c1c1a;--soft:#63635e;--grid:#d6d6d0;\
--c1:#2a78d6;--c2:#d9541e;--c3:#16936a;--c4:#7a5fd0;--c5:#b87f00;--c6:#d43f3f}
@media (prefers-color-scheme:dark){:root{--back:#1a1a19;--ink:#f0f0ea;--soft:#a9a9a2;\
--grid:#46463f;--c1:#4c97ee;--c2:#ee7a48;--c3:#2bb587;--c4:#a296f0;--c5:#d59a1c;--c6:#ee7474}}
body{background:var(--back);color:var(--ink);font:15px/1.45 system-ui,sans-serif;\
margin:0 auto;max-width:1240px;padding:1.2rem}
h1{font-size:1.5rem;margin:0 0 .3rem}h2{font-size:1.15rem;margin:2.2rem 0 .4rem}
h3{font-size:1rem;margin:.6rem 0 .2rem}p{max-width:75ch;margin:.3rem 0 .7rem}
.soft,caption{color:var(--soft);font-size:.87rem}
.pair{display:grid;grid-template-columns:repeat(2,minmax(0,1fr));gap:1.4rem}
@media (max-width:800px){.pair{grid-template-columns:minmax(0,1fr)}}
.wide{overflow-x:auto}.wide td:first-child{white-space:nowrap}
svg{width:100%;height:auto;display:block;color:var(--ink)}
table{border-collapse:collapse;font-size:.87rem;font-variant-numeric:tabular-nums}
caption{text-align:left;padding:.2rem 0}
th,td{padding:.2rem .6rem;text-align:left;border-bottom:1px solid var(--grid);vertical-align:top}
th{font-weight:600}td.n,th.n{text-align:right}tr.group th{padding-top:1rem}
.matrix th,.matrix td{padding:.15rem .25rem;text-align:center;border:1px solid var(--grid)}
.matrix thead th{writing-mode:vertical-rl;transform:rotate(180deg);text-align:left}
.matrix thead th.corner{writing-mode:horizontal-tb;transform:none;vertical-align:bottom}
.matrix tbody th{text-align:right;font-weight:400}.matrix thead th{font-weight:400}
.right{outline:3px solid var(--f0);outline-offset:-3px}
.key{font-size:.85rem;margin:0 0 .3rem}.key span{white-space:nowrap;margin-right:1rem}
.key i{display:inline-block;width:1.3em;height:0;border-top:3px solid;vertical-align:middle;\
margin-right:.35em}.key i.dashed{border-top-style:dashed}.key i.dotted{border-top-style:dotted}
.verdict{font-size:1.15rem;max-width:70ch}.index{font-size:.9rem}.index a{margin-right:1.1rem;\
color:inherit;white-space:nowrap}.chart h3{margin-top:1.2rem}.chart{max-width:1240px}
.close{font-size:.78rem;margin-bottom:1rem}.close th,.close td{padding:.2rem .35rem;\
white-space:nowrap}.close .soft{font-size:inherit}
.run{margin:.9rem 0;border-top:1px solid var(--grid);padding-top:.4rem}
code{overflow-wrap:anywhere}details{margin:.5rem 0}summary{cursor:pointer}\
";

/// A part of a page with a heading of its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Section {
    /// By which the index finds it.
    pub id: &'static str,
    /// Its heading.
    pub heading: &'static str,
    /// What is to be known of it.
    pub about: String,
    /// What stands in it, as markup.
    pub inside: String,
}

/// A whole page: what matters most in words, an index, and the sections.
pub fn page(title: &str, verdict: &str, sections: &[Section]) -> String {
    let link = |section: &Section| {
        let heading = escaped(section.heading);
        format!("<a href=\"#{}\">{heading}</a>\n", section.id)
    };
    let index: String = sections.iter().map(link).collect();
    let body: String = sections.iter().map(Section::html).collect();
    let (title, verdict) = (escaped(title), escaped(verdict));
    let (light, dark) = (variables(false), variables(true));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <title>{title}</title>\n<style>\n{STYLE}:root{{{light}}}\n\
         @media (prefers-color-scheme:dark){{:root{{{dark}}}}}\n</style>\n</head>\n<body>\n\
         <header><h1>{title}</h1>\n<p class=\"verdict\">{verdict}</p>\n\
         <nav class=\"index\">{index}</nav></header>\n{body}</body>\n</html>\n"
    )
}

impl Section {
    fn html(&self) -> String {
        let about = match self.about.as_str() {
            "" => String::new(),
            about => format!("<p class=\"soft\">{}</p>\n", escaped(about)),
        };
        format!(
            "<section id=\"{}\">\n<h2>{}</h2>\n{about}{}</section>\n",
            self.id,
            escaped(self.heading),
            self.inside
        )
    }
}

/// A chart below its title.
pub fn titled(title: &str, key: &str, svg: &str) -> String {
    let title = escaped(title);
    format!("<div class=\"chart\"><h3>{title}</h3>\n{key}{svg}</div>\n")
}

/// A paragraph in small letters.
pub fn remark(words: &str) -> String {
    format!("<p class=\"soft\">{}</p>\n", escaped(words))
}

/// A table; without heads if none has a name.
pub fn table(heads: &[&str], rows: &[Vec<String>]) -> String {
    let cell = |words: &String| format!("<td>{}</td>", escaped(words));
    let row = |row: &Vec<String>| {
        let cells: String = row.iter().map(cell).collect();
        format!("<tr>{cells}</tr>\n")
    };
    let rows: String = rows.iter().map(row).collect();
    let head = |words: &&str| format!("<th>{}</th>", escaped(words));
    let heads = match heads.iter().all(|head| head.is_empty()) {
        true => String::new(),
        false => format!(
            "<thead><tr>{}</tr></thead>\n",
            heads.iter().map(head).collect::<String>()
        ),
    };
    format!("<div class=\"wide\"><table>\n{heads}<tbody>\n{rows}</tbody></table></div>\n")
}

/// Two things beside each other.
pub fn beside(parts: &[String]) -> String {
    let parts = parts.iter().map(|part| format!("<div>\n{part}</div>\n"));
    format!(
        "<div class=\"pair\">\n{}</div>\n",
        parts.collect::<String>()
    )
}

/// The name of a curve.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeyEntry {
    /// Its colour.
    pub colour: Colour,
    /// How it is drawn.
    pub stroke: Stroke,
    /// Its name.
    pub name: String,
}

impl KeyEntry {
    /// Of [`crate::chart::Curve::bound`].
    #[must_use]
    pub const fn bound(name: String) -> Self {
        Self {
            colour: Colour::Alarm,
            stroke: Stroke::Dashed,
            name,
        }
    }
}

/// Names of the curves of a chart.
pub fn key(entries: &[KeyEntry]) -> String {
    let entry = |entry: &KeyEntry| {
        let class = match entry.stroke {
            Stroke::Dashed => " class=\"dashed\"",
            Stroke::Dotted => " class=\"dotted\"",
            _ => "",
        };
        let (colour, name) = (entry.colour.css(), escaped(&entry.name));
        format!("<span><i{class} style=\"border-color:{colour}\"></i>{name}</span> ")
    };
    let entries = entries.iter().map(entry).collect::<String>();
    format!("<p class=\"key\">{entries}</p>\n")
}
