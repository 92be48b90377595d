#![doc = include_str!("../README.md")]

use proc_macro::TokenStream;
use proc_macro2::TokenStream as Tokens;
use quote::{format_ident, quote};
use syn::spanned::Spanned;
use syn::{
    Data, DeriveInput, Error, Field, Fields, Generics, Ident, Index, Member, Path, Variant,
    parse_macro_input,
};

/// How a field takes part.
#[derive(Clone)]
enum Part {
    /// It is saved and loaded.
    State,
    /// It follows from the configuration, or means nothing between two steps: it is left as it is.
    Fixed,
    /// A collection whose length follows from the configuration: each element is loaded in place.
    Each,
    /// A module has the functions `save` and `load`, for a type that knows no checkpoints.
    With(Path),
}

/// Derives `Checkpoint`: fields are saved and loaded in place, one after the other. Of an enum, the
/// variant is to be the same.
///
/// `#[checkpoint(fixed)]` and `#[checkpoint(scratch)]` leave a field out. `#[checkpoint(each)]`
/// keeps a collection's length. `#[checkpoint(with = path)]` uses `path::save` and `path::load`.
/// `#[checkpoint(bound = "T: Bound")]` on the type adds a bound.
#[proc_macro_derive(Checkpoint, attributes(checkpoint))]
pub fn derive_checkpoint(input: TokenStream) -> TokenStream {
    derive(input, in_place_struct, in_place_enum)
}

/// Derives `Checkpoint` and `CheckpointValue`: the whole value is state, and is made anew.
#[proc_macro_derive(CheckpointValue, attributes(checkpoint))]
pub fn derive_checkpoint_value(input: TokenStream) -> TokenStream {
    derive(input, value_struct, value_enum)
}

fn derive(
    input: TokenStream,
    of_struct: fn(&DeriveInput, &Fields) -> Result<Tokens, Error>,
    of_enum: fn(&DeriveInput, &[&Variant]) -> Result<Tokens, Error>,
) -> TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    let derived = match &input.data {
        Data::Struct(data) => of_struct(&input, &data.fields),
        Data::Enum(data) => of_enum(&input, &data.variants.iter().collect::<Vec<_>>()),
        Data::Union(_) => Err(Error::new(input.span(), "a union has no state of its own")),
    };
    derived.unwrap_or_else(Error::into_compile_error).into()
}

fn part(field: &Field) -> Result<Part, Error> {
    let mut part = Part::State;
    for attribute in &field.attrs {
        if attribute.path().is_ident("checkpoint") {
            attribute.parse_nested_meta(|meta| {
                part = match meta.path.get_ident().map(ToString::to_string).as_deref() {
                    Some("fixed" | "scratch") => Part::Fixed,
                    Some("each") => Part::Each,
                    Some("with") => Part::With(meta.value()?.parse()?),
                    _ => return Err(meta.error("allowed: fixed, scratch, each, with = path")),
                };
                Ok(())
            })?;
        }
    }
    Ok(part)
}

/// The generics with the bounds that the type asks for.
fn bounded(input: &DeriveInput) -> Result<Generics, Error> {
    let mut generics = input.generics.clone();
    for attribute in &input.attrs {
        if attribute.path().is_ident("checkpoint") {
            attribute.parse_nested_meta(|meta| {
                if !meta.path.is_ident("bound") {
                    return Err(meta.error("allowed: bound = \"T: Bound\""));
                }
                let text: syn::LitStr = meta.value()?.parse()?;
                let bound: syn::WherePredicate = text.parse()?;
                generics.make_where_clause().predicates.push(bound);
                Ok(())
            })?;
        }
    }
    Ok(generics)
}

fn members(fields: &Fields) -> Vec<Member> {
    let member = |(place, field): (usize, &Field)| match &field.ident {
        Some(name) => Member::Named(name.clone()),
        None => Member::Unnamed(Index::from(place)),
    };
    fields.iter().enumerate().map(member).collect()
}

/// A hash of a type's name, and of the names and types of its fields: by it a reader knows that
/// they are still the same.
fn mark(input: &DeriveInput, fields: &Fields) -> Result<u32, Error> {
    let mut text = input.ident.to_string();
    push_fields(&mut text, fields)?;
    Ok(hashed(&text))
}

/// The same of an enum with its variants; there is room for the number of one in the last byte.
fn mark_of_variants(input: &DeriveInput, variants: &[&Variant]) -> Result<u32, Error> {
    let mut text = input.ident.to_string();
    for variant in variants {
        text.push_str(&format!(" {}", variant.ident));
        push_fields(&mut text, &variant.fields)?;
    }
    match variants.len() {
        1..=256 => Ok(hashed(&text) & 0xffff_ff00),
        _ => Err(Error::new(input.span(), "allowed are 1 to 256 variants")),
    }
}

fn push_fields(text: &mut String, fields: &Fields) -> Result<(), Error> {
    for (field, member) in fields.iter().zip(members(fields)) {
        if !matches!(part(field)?, Part::Fixed) {
            let of = &field.ty;
            text.push_str(&format!(" {}: {}", quote!(#member), quote!(#of)));
        }
    }
    Ok(())
}

/// FNV-1a.
fn hashed(text: &str) -> u32 {
    text.bytes().fold(0x811c_9dc5, |hash, byte| {
        (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
    })
}

fn save_of(part: &Part, of: &Tokens) -> Tokens {
    match part {
        Part::State => quote!(vigil_checkpoint::Checkpoint::save(#of, to);),
        Part::Fixed => quote!(),
        Part::Each => quote!(vigil_checkpoint::save_each(#of.iter(), to);),
        Part::With(path) => quote!(#path::save(#of, to);),
    }
}

fn load_of(part: &Part, of: &Tokens) -> Tokens {
    match part {
        Part::State => quote!(vigil_checkpoint::Checkpoint::load(#of, from);),
        Part::Fixed => quote!(),
        Part::Each => quote!(vigil_checkpoint::load_each(#of.iter_mut(), from);),
        Part::With(path) => quote!(#path::load(#of, from);),
    }
}

/// A pattern that takes a variant apart, and the names it gives the fields.
fn pattern(variant: &Variant) -> (Tokens, Vec<Ident>) {
    let members = members(&variant.fields);
    let names: Vec<_> = (0..members.len())
        .map(|i| format_ident!("field_{i}"))
        .collect();
    let name = &variant.ident;
    (quote!(Self::#name { #(#members: #names),* }), names)
}

/// `Checkpoint`, from what saves and what loads.
fn in_place(input: &DeriveInput, save: &Tokens, load: &Tokens) -> Result<Tokens, Error> {
    let name = &input.ident;
    let generics = bounded(input)?;
    let (of, types, bounds) = generics.split_for_impl();
    Ok(quote! {
        impl #of vigil_checkpoint::Checkpoint for #name #types #bounds {
            #[allow(unused_variables)]
            fn save(&self, to: &mut vigil_checkpoint::CheckpointWriter<'_>) {
                #save
            }
            #[allow(unused_variables)]
            fn load(&mut self, from: &mut vigil_checkpoint::CheckpointReader<'_>) {
                #load
            }
        }
    })
}

/// `CheckpointValue`, beside `Checkpoint`, from what reads.
fn value(input: &DeriveInput, in_place: &Tokens, read: &Tokens) -> Result<Tokens, Error> {
    let name = &input.ident;
    let generics = bounded(input)?;
    let (of, types, bounds) = generics.split_for_impl();
    Ok(quote! {
        #in_place
        impl #of vigil_checkpoint::CheckpointValue for #name #types #bounds {
            fn read(from: &mut vigil_checkpoint::CheckpointReader<'_>) -> Self {
                #read
            }
        }
    })
}

fn in_place_struct(input: &DeriveInput, fields: &Fields) -> Result<Tokens, Error> {
    let (mut saves, mut loads) = (Vec::new(), Vec::new());
    for (field, member) in fields.iter().zip(members(fields)) {
        let part = part(field)?;
        saves.push(save_of(&part, &quote!((&self.#member))));
        loads.push(load_of(&part, &quote!((&mut self.#member))));
    }
    let (text, mark) = (input.ident.to_string(), mark(input, fields)?);
    let save = quote!(to.mark(#mark); #(#saves)*);
    let load = quote!(from.expect(#mark, #text); #(#loads)*);
    in_place(input, &save, &load)
}

fn in_place_enum(input: &DeriveInput, variants: &[&Variant]) -> Result<Tokens, Error> {
    let text = input.ident.to_string();
    let (mut saves, mut loads) = (Vec::new(), Vec::new());
    for (tag, variant) in variants.iter().enumerate() {
        let (pattern, names) = pattern(variant);
        let mark = mark(input, &variant.fields)? ^ tag as u32;
        let (mut save, mut load) = (Vec::new(), Vec::new());
        for (field, name) in variant.fields.iter().zip(&names) {
            let part = part(field)?;
            save.push(save_of(&part, &quote!(#name)));
            load.push(load_of(&part, &quote!(#name)));
        }
        saves.push(quote!(#pattern => { to.mark(#mark); #(#save)* }));
        loads.push(quote!(#pattern => { from.expect(#mark, #text); #(#load)* }));
    }
    let save = quote!(match self { #(#saves)* });
    in_place(input, &save, &quote!(match self { #(#loads)* }))
}

fn value_struct(input: &DeriveInput, fields: &Fields) -> Result<Tokens, Error> {
    for field in fields {
        if !matches!(part(field)?, Part::State) {
            return Err(Error::new(field.span(), "a value has no fixed parts"));
        }
    }
    let (members, text, mark) = (
        members(fields),
        input.ident.to_string(),
        mark(input, fields)?,
    );
    let read = quote! {
        from.expect(#mark, #text);
        Self { #(#members: vigil_checkpoint::CheckpointValue::read(from)),* }
    };
    value(input, &in_place_struct(input, fields)?, &read)
}

fn value_enum(input: &DeriveInput, variants: &[&Variant]) -> Result<Tokens, Error> {
    let text = input.ident.to_string();
    let mark = mark_of_variants(input, variants)?;
    let (mut saves, mut reads) = (Vec::new(), Vec::new());
    for (tag, variant) in variants.iter().enumerate() {
        let (variant_name, tag) = (&variant.ident, tag as u32);
        let (pattern, names) = pattern(variant);
        saves.push(quote! {
            #pattern => {
                to.mark(#mark | #tag);
                #(vigil_checkpoint::Checkpoint::save(#names, to);)*
            }
        });
        let members = members(&variant.fields);
        let read = quote! {
            Self::#variant_name { #(#members: vigil_checkpoint::CheckpointValue::read(from)),* }
        };
        // The first is also what a reader that has failed gives.
        reads.push(match tag {
            0 => quote!(_ => #read,),
            _ => quote!(#tag => #read,),
        });
    }
    reads.rotate_left(1);
    let count = variants.len() as u32;
    let save = quote!(match self { #(#saves)* });
    let load = quote!(*self = vigil_checkpoint::CheckpointValue::read(from););
    let read = quote!(match from.variant(#mark, #count, #text) { #(#reads)* });
    value(input, &in_place(input, &save, &load)?, &read)
}
