//! Where things stand in an XML file: urdf-rs keeps no places, so the tags are scanned for them.

use crate::fault::Fault;

/// One start tag.
struct Tag {
    name: String,
    attributes: Vec<(String, String)>,
    offset: usize,
    /// Index of the tag it stands in.
    parent: Option<usize>,
}

impl Tag {
    fn attribute(&self, key: &str) -> Option<&str> {
        self.attributes.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str())
    }
}

/// The tags of a file with their places.
pub(super) struct Source<'t> {
    file: String,
    text: &'t str,
    tags: Vec<Tag>,
}

const JOINT_TYPES: [&str; 7] = ["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical"];
const SHAPES: [&str; 5] = ["box", "cylinder", "capsule", "sphere", "mesh"];

impl<'t> Source<'t> {
    /// Scans the tags and refuses what urdf-rs would refuse without a place: words it does not know.
    pub(super) fn scan(file: &str, text: &'t str) -> Result<Self, Vec<Fault>> {
        let source = Self { file: file.to_owned(), text, tags: tags(text) };
        let Some(robot) = source.tags.iter().find(|tag| tag.parent.is_none()) else {
            let advice = "name a URDF file";
            return Err(vec![source.fault(None, "", "no XML element", "a <robot> element", advice)]);
        };
        if robot.name != "robot" {
            let found = format!("a <{}> element", robot.name);
            let advice = "name a URDF file; expand xacro files first";
            return Err(vec![source.fault(Some(robot.offset), "", &found, "a <robot> element", advice)]);
        }
        let faults = source.unknown_words();
        if faults.is_empty() { Ok(source) } else { Err(faults) }
    }

    fn unknown_words(&self) -> Vec<Fault> {
        let mut faults = Vec::new();
        let parent = |tag: &Tag| tag.parent.map_or("", |index| self.tags[index].name.as_str());
        for tag in &self.tags {
            let at = Some(tag.offset);
            match (parent(tag), tag.name.as_str()) {
                ("robot", kind @ ("link" | "joint")) if tag.attribute("name").is_none() => {
                    faults.push(self.fault(at, &format!("{kind} name"), "missing", "", "name it"));
                }
                ("robot", "joint") => {
                    let field = format!("joint \"{}\" type", tag.attribute("name").unwrap_or_default());
                    let kind = tag.attribute("type").unwrap_or("missing");
                    if !JOINT_TYPES.contains(&kind) {
                        let advice = "use one of these";
                        let found = if kind == "missing" { kind.to_owned() } else { format!("\"{kind}\"") };
                        faults.push(self.fault(at, &field, &found, "revolute, continuous, prismatic, fixed", advice));
                    }
                }
                ("geometry", shape) if !SHAPES.contains(&shape) => {
                    let found = format!("a <{shape}> shape");
                    faults.push(self.fault(at, "", &found, "box, cylinder, capsule, sphere, mesh", "use one of these"));
                }
                _ => {}
            }
        }
        faults
    }

    /// The fault that urdf-rs's own words come to.
    pub(super) fn refused(&self, words: &str) -> Fault {
        // RustyXML: "Parse error; Line: 3, Column: 7, Reason: …".
        let number = |key: &str| {
            let rest = &words[words.find(key)? + key.len()..];
            rest[..rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len())].parse::<usize>().ok()
        };
        let reason = words.split("Reason: ").nth(1).unwrap_or(words).trim();
        let mut fault = self.fault(None, "", &format!("not a URDF: {reason}"), "", "mend the file");
        if let (Some(line), Some(column)) = (number("Line: "), number("Column: ")) {
            (fault.line, fault.column) = (line, column.max(1));
        }
        fault
    }

    /// A fault of the robot as a whole, at its tag.
    pub(super) fn fault_of_robot(&self, field: &str, found: &str, allowed: &str, advice: &str) -> Fault {
        self.fault(self.tags.first().map(|tag| tag.offset), field, found, allowed, advice)
    }

    /// A fault of `what` of a joint or link (`kind`), at its element `child` where it has one.
    /// `child` may be empty, or a path such as `collision/geometry/mesh`, then the first of that path.
    #[allow(clippy::too_many_arguments, reason = "a place and the four things a message says")]
    pub(super) fn fault_in(
        &self,
        kind: &str,
        name: &str,
        child: &str,
        what: &str,
        found: &str,
        allowed: &str,
        advice: &str,
    ) -> Fault {
        self.fault_in_nth(kind, name, child, 0, what, found, allowed, advice)
    }

    /// As [`Source::fault_in`], at the child of that path and number.
    #[allow(clippy::too_many_arguments, reason = "a place and the four things a message says")]
    pub(super) fn fault_in_nth(
        &self,
        kind: &str,
        name: &str,
        child: &str,
        number: usize,
        what: &str,
        found: &str,
        allowed: &str,
        advice: &str,
    ) -> Fault {
        let at = self.find(kind, name).map(|element| {
            let inner = self.descend(element, child, number).unwrap_or(element);
            self.tags[inner].offset
        });
        let space = if what.is_empty() { "" } else { " " };
        self.fault(at, &format!("{kind} \"{name}\"{space}{what}"), found, allowed, advice)
    }

    /// A fault of the last element of that kind and name: the one that repeats another.
    pub(super) fn fault_of_repeated(&self, kind: &str, name: &str) -> Fault {
        let at = self.tags.iter().rfind(|tag| tag.name == kind && tag.attribute("name") == Some(name));
        let found = format!("a second {kind} of that name");
        let field = format!("{kind} \"{name}\" name");
        self.fault(at.map(|tag| tag.offset), &field, &found, "each name once", "rename one of them")
    }

    fn find(&self, kind: &str, name: &str) -> Option<usize> {
        let top = |tag: &Tag| tag.parent.is_some_and(|parent| self.tags[parent].parent.is_none());
        self.tags.iter().position(|tag| tag.name == kind && top(tag) && tag.attribute("name") == Some(name))
    }

    fn descend(&self, element: usize, path: &str, number: usize) -> Option<usize> {
        let mut at = element;
        for (depth, name) in path.split('/').enumerate() {
            let skip = if depth == 0 { number } else { 0 };
            let inside = |(_, tag): &(usize, &Tag)| tag.parent == Some(at) && tag.name == name;
            at = self.tags.iter().enumerate().filter(inside).nth(skip)?.0;
        }
        Some(at)
    }

    /// Offset and two attributes of every element of that name directly below the root.
    pub(super) fn pairs<'s>(
        &'s self,
        name: &'s str,
        keys: [&'s str; 2],
    ) -> impl Iterator<Item = (usize, [Option<&'s str>; 2])> {
        let top = |tag: &&Tag| tag.parent.is_some_and(|parent| self.tags[parent].parent.is_none());
        let named = self.tags.iter().filter(top).filter(move |tag| tag.name == name);
        named.map(move |tag| (tag.offset, keys.map(|key| tag.attribute(key))))
    }

    /// A fault at an offset.
    pub(super) fn fault(&self, at: Option<usize>, field: &str, found: &str, allowed: &str, advice: &str) -> Fault {
        let (line, column) = at.map_or((0, 0), |offset| {
            let before = &self.text[..offset];
            let start = before.rfind('\n').map_or(0, |newline| newline + 1);
            (before.matches('\n').count() + 1, before[start..].chars().count() + 1)
        });
        Fault {
            file: self.file.clone(),
            line,
            column,
            field: field.to_owned(),
            found: found.to_owned(),
            allowed: allowed.to_owned(),
            advice: advice.to_owned(),
        }
    }
}

/// All start tags, in order. Lenient: what is not well-formed is urdf-rs's to refuse.
fn tags(text: &str) -> Vec<Tag> {
    let mut tags: Vec<Tag> = Vec::new();
    let mut open: Vec<usize> = Vec::new();
    let mut at = 0;
    let past = |from: usize, end: &str| text[from..].find(end).map_or(text.len(), |found| from + found + end.len());
    while let Some(found) = text[at..].find('<') {
        let start = at + found;
        let rest = &text[start..];
        at = if rest.starts_with("<!--") {
            past(start, "-->")
        } else if rest.starts_with("<![CDATA[") {
            past(start, "]]>")
        } else if rest.starts_with("<?") {
            past(start, "?>")
        } else if rest.starts_with("<!") {
            past(start, ">")
        } else if rest.starts_with("</") {
            open.pop();
            past(start, ">")
        } else {
            let end = end_of_tag(text, start);
            let inside = text[start + 1..end].trim_end_matches('>');
            let empty = inside.ends_with('/');
            let inside = inside.trim_end_matches('/');
            let name_end = inside.find(char::is_whitespace).unwrap_or(inside.len());
            let tag = Tag {
                name: inside[..name_end].to_owned(),
                attributes: attributes(&inside[name_end..]),
                offset: start,
                parent: open.last().copied(),
            };
            if !empty {
                open.push(tags.len());
            }
            tags.push(tag);
            end
        };
    }
    tags
}

/// Just past the `>` of a tag, quoted ones skipped.
fn end_of_tag(text: &str, start: usize) -> usize {
    let mut quote = None;
    for (index, character) in text[start..].char_indices() {
        match (quote, character) {
            (None, '"' | '\'') => quote = Some(character),
            (None, '>') => return start + index + 1,
            (Some(open), close) if open == close => quote = None,
            _ => {}
        }
    }
    text.len()
}

fn attributes(mut text: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    while let Some((key, rest)) = text.split_once('=') {
        let rest = rest.trim_start();
        let Some(quote) = rest.chars().next().filter(|c| matches!(c, '"' | '\'')) else { break };
        let Some((value, after)) = rest[1..].split_once(quote) else { break };
        found.push((key.trim().to_owned(), value.to_owned()));
        text = after;
    }
    found
}
