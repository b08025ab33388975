//! Networks that gear knows, so that nobody has to copy a declaration beside a file that others publish.

use gear_graph::{Choice, Param};

/// A network that gear knows by name; its declaration is a file in the folder `networks` of this crate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Familiar {
    /// PiDiNet (Su et al. 2021), contours.
    Pidinet,
    /// U²-Netp (Qin et al. 2020), what is figure.
    #[choice(name = "u2netp")]
    U2netp,
    /// Depth Anything V2 (Yang et al. 2024), inverse depth.
    #[choice(name = "depth-anything-v2")]
    DepthAnythingV2,
    /// gear's own prior: normals and height of painted shapes.
    PriorUnet,
}

impl Familiar {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Pidinet, Self::U2netp, Self::DepthAnythingV2, Self::PriorUnet];

    /// The name in graphs.
    pub fn name(self) -> String {
        match self.write() {
            gear_graph::ParamValue::String(name) => name,
            other => other.to_string(),
        }
    }

    /// What goes into it and what comes out, as YAML.
    pub fn declaration(self) -> &'static str {
        match self {
            Self::Pidinet => include_str!("../networks/pidinet.yaml"),
            Self::U2netp => include_str!("../networks/u2netp.yaml"),
            Self::DepthAnythingV2 => include_str!("../networks/depth-anything-v2.yaml"),
            Self::PriorUnet => include_str!("../networks/prior_unet.yaml"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Declaration;

    #[test]
    fn every_one_has_a_declaration_that_says_whose_it_is() {
        for familiar in Familiar::ALL {
            let name = familiar.name();
            let declaration = Declaration::read(&name, familiar.declaration());
            let declaration = declaration.unwrap_or_else(|mistakes| panic!("{mistakes}"));
            assert!(
                !declaration.licence.is_empty() && !declaration.source.is_empty(),
                "{name}"
            );
        }
        let names = Familiar::ALL.map(Familiar::name);
        assert_eq!(names, ["pidinet", "u2netp", "depth-anything-v2", "prior-unet"]);
    }
}
