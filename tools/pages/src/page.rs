//! The page around the sections: one file, no script, nothing loaded.

/// Style of the page; colours for light and dark.
const STYLE: &str = "\
:root{color-scheme:light dark;--back:#fcfcfb;--ink:#1c1c1a;--soft:#63635e;--grid:#d6d6d0;\
--c1:#2a78d6;--c2:#d9541e;--c3:#16936a;--c4:#7a5fd0;--c5:#b87f00;--c6:#d43f3f;\
--good:27 150 110;--bad:212 63 63}
@media (prefers-color-scheme:dark){:root{--back:#1a1a19;--ink:#f0f0ea;--soft:#a9a9a2;\
--grid:#46463f;--c1:#4c97ee;--c2:#ee7a48;--c3:#2bb587;--c4:#a296f0;--c5:#d59a1c;--c6:#ee7474;\
--good:43 181 135;--bad:238 116 116}}
body{background:var(--back);color:var(--ink);font:15px/1.45 system-ui,sans-serif;\
margin:0 auto;max-width:1240px;padding:1.2rem}
h1{font-size:1.5rem;margin:0 0 .3rem}h2{font-size:1.15rem;margin:2.2rem 0 .4rem}
h3{font-size:1rem;margin:.6rem 0 .2rem}p{max-width:75ch;margin:.3rem 0 .7rem}
.soft,caption{color:var(--soft);font-size:.87rem}
.pair{display:grid;grid-template-columns:repeat(2,minmax(0,1fr));gap:1.4rem}
@media (max-width:800px){.pair{grid-template-columns:minmax(0,1fr)}}
.wide{overflow-x:auto}svg{width:100%;height:auto;display:block;color:var(--ink)}
table{border-collapse:collapse;font-size:.87rem;font-variant-numeric:tabular-nums}
caption{text-align:left;padding:.2rem 0}
th,td{padding:.2rem .6rem;text-align:left;border-bottom:1px solid var(--grid);vertical-align:top}
th{font-weight:600}td.n,th.n{text-align:right}tr.group th{padding-top:1rem}
.matrix th,.matrix td{padding:.15rem .25rem;text-align:center;border:1px solid var(--grid)}
.matrix thead th{writing-mode:vertical-rl;transform:rotate(180deg);text-align:left}
.matrix thead th.corner{writing-mode:horizontal-tb;transform:none;vertical-align:bottom}
.matrix tbody th{text-align:right;font-weight:400}.matrix thead th{font-weight:400}
.right{background:rgb(var(--good)/var(--a))}.wrong{background:rgb(var(--bad)/var(--a))}
.key{font-size:.85rem;margin:0 0 .3rem}.key span{white-space:nowrap;margin-right:1rem}
.key i{display:inline-block;width:1.3em;height:0;border-top:3px solid;vertical-align:middle;\
margin-right:.35em}.key i.dashed{border-top-style:dashed}
.close{font-size:.78rem;margin-bottom:1rem}.close th,.close td{padding:.2rem .35rem;\
white-space:nowrap}.close .soft{font-size:inherit}
.run{margin:.9rem 0;border-top:1px solid var(--grid);padding-top:.4rem}
code{overflow-wrap:anywhere}details{margin:.5rem 0}summary{cursor:pointer}\
";

/// A whole page.
pub fn page(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <title>{}</title>\n<style>\n{STYLE}\n</style>\n</head>\n<body>\n{body}</body>\n</html>\n",
        escaped(title)
    )
}

/// Text that is no markup.
pub fn escaped(text: &str) -> String {
    let mut found = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => found.push_str("&amp;"),
            '<' => found.push_str("&lt;"),
            '>' => found.push_str("&gt;"),
            '"' => found.push_str("&quot;"),
            // Not allowed in a page, whatever a command line holds.
            letter if letter.is_control() => found.push('\u{fffd}'),
            letter => found.push(letter),
        }
    }
    found
}

/// A section with its heading and what is to be known of it.
pub fn section(id: &str, heading: &str, about: &str, inside: &str) -> String {
    format!(
        "<section id=\"{id}\">\n<h2>{}</h2>\n<p class=\"soft\">{}</p>\n{inside}</section>\n",
        escaped(heading),
        escaped(about)
    )
}

/// Two things beside each other.
pub fn beside(parts: &[String]) -> String {
    let parts = parts.iter().map(|part| format!("<div>\n{part}</div>\n"));
    format!(
        "<div class=\"pair\">\n{}</div>\n",
        parts.collect::<String>()
    )
}

/// Names of the curves of a chart: colour, name, broken or not.
pub fn key(names: &[(usize, &str, bool)]) -> String {
    let name = |(colour, name, dashed): &(usize, &str, bool)| {
        let class = if *dashed { " class=\"dashed\"" } else { "" };
        let name = escaped(name);
        format!("<span><i{class} style=\"border-color:var(--c{colour})\"></i>{name}</span> ")
    };
    let names = names.iter().map(name).collect::<String>();
    format!("<p class=\"key\">{names}</p>\n")
}
