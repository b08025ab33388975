//! A sample as it is written on a command line or in a study: `figure-3,condition=photo,light=right,seed=2`.

use crate::{Background, Condition, Options, SampleError, exists};

/// Which raster of a sample a picture is to show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Show {
    /// The painting.
    #[default]
    Painting,
    /// True normals as colours `n/2 + ½`, ½ outside the figure.
    Normals,
    /// The reflectance, without light and lines.
    Albedo,
}

/// A name and options.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Name of the motif or scene.
    pub name: String,
    /// How it is painted.
    pub options: Options,
    /// What is shown of it, where a picture is asked for.
    pub show: Show,
}

/// Lights by name, towards the light: x right, y up, z to the viewer.
pub const LIGHTS: [(&str, [f64; 3]); 5] = [
    ("upper-left", [-0.5, 0.55, 0.67]),
    ("right", [0.6, 0.3, 0.74]),
    ("above", [0.05, 0.75, 0.66]),
    ("low-left", [-0.6, -0.25, 0.76]),
    ("front", [0.0, 0.15, 0.99]),
];

impl Request {
    /// Reads `NAME` or `NAME,KEY=VALUE,…` with the keys `light`, `seed`, `condition`, `background` and `show`.
    pub fn parse(text: &str, longer_side: usize) -> Result<Self, SampleError> {
        let mut parts = text.split(',');
        let name = parts.next().unwrap_or_default().trim();
        if !exists(name) {
            return Err(SampleError::UnknownName { found: name.to_owned() });
        }
        let mut request = Self {
            name: name.to_owned(),
            options: Options {
                longer_side,
                ..Options::default()
            },
            show: Show::default(),
        };
        let mut seen: Vec<&str> = Vec::new();
        for part in parts {
            let part = part.trim();
            let (key, value) = part.split_once('=').ok_or_else(|| option(part, KEYS))?;
            if seen.contains(&key) {
                return Err(option(part, "every key once"));
            }
            seen.push(key);
            request.set(key, value).map_err(|expected| option(part, &expected))?;
        }
        Ok(request)
    }

    /// Whether nothing was asked for beyond the name.
    pub fn has_default_options(&self) -> bool {
        let options = Options {
            longer_side: self.options.longer_side,
            ..Options::default()
        };
        self.options == options && self.show == Show::default()
    }

    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        let options = &mut self.options;
        match key {
            "light" => options.light = light(value).ok_or_else(|| format!("light={}", lights().join("|")))?,
            "seed" => options.seed = value.parse().map_err(|_| "seed=NUMBER from 0".to_owned())?,
            "condition" => {
                options.condition = match value {
                    "paint" => Condition::Paint,
                    "photo" => Condition::Photo,
                    "flat" => Condition::Flat,
                    _ => return Err("condition=paint|photo|flat".into()),
                }
            }
            "background" => {
                options.background = match value {
                    "plain" => Background::Plain,
                    "textured" => Background::Textured,
                    "bordered" => Background::Bordered,
                    _ => return Err("background=plain|textured|bordered".into()),
                }
            }
            "show" => {
                self.show = match value {
                    "painting" => Show::Painting,
                    "normals" => Show::Normals,
                    "albedo" => Show::Albedo,
                    _ => return Err("show=painting|normals|albedo".into()),
                }
            }
            _ => return Err(KEYS.into()),
        }
        Ok(())
    }
}

const KEYS: &str = "light=, seed=, condition=, background= or show=";

fn option(found: &str, expected: &str) -> SampleError {
    SampleError::Option {
        found: found.to_owned(),
        expected: expected.to_owned(),
    }
}

/// The direction of a light by its name.
pub fn light(name: &str) -> Option<[f64; 3]> {
    LIGHTS.iter().find(|(known, _)| *known == name).map(|(_, light)| *light)
}

fn lights() -> Vec<&'static str> {
    LIGHTS.iter().map(|(name, _)| *name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_alone_has_the_default_options() {
        let request = Request::parse("vessel", 96).unwrap();
        let options = Options {
            longer_side: 96,
            ..Options::default()
        };
        assert_eq!((request.options, request.show), (options, Show::Painting));
        assert_eq!(light("upper-left"), Some(options.light));
    }

    #[test]
    fn options_are_read_in_any_order() {
        let request = Request::parse(
            "figure-3,seed=7,condition=photo,light=right,background=plain,show=normals",
            96,
        );
        let request = request.unwrap();
        assert_eq!((request.name.as_str(), request.show), ("figure-3", Show::Normals));
        let options = request.options;
        assert_eq!(
            (options.seed, options.condition, options.background),
            (7, Condition::Photo, Background::Plain)
        );
        assert_eq!(options.light, [0.6, 0.3, 0.74]);
    }

    #[test]
    fn what_cannot_be_read_is_told_with_what_can() {
        for (text, said) in [
            ("cat", "court-lady"),
            ("figure-0", "figure-N"),
            ("figure-01", "figure-N"),
            ("vessel,light=moon", "upper-left|right"),
            ("vessel,colour=red", "condition="),
            ("vessel,plain", "background="),
            ("vessel,seed=-1", "from 0"),
            ("vessel,seed=1,seed=2", "once"),
        ] {
            let message = Request::parse(text, 96).unwrap_err().to_string();
            assert!(message.contains(said), "{text}: {message}");
        }
    }
}
