//! Where a service is, which model it is asked for, and its key: all from the environment.

use std::fmt;

use crate::ServiceError;

/// A text that never shows: not in a log, not in an error.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(String);

impl Secret {
    /// The text, for the one header that carries it.
    pub(crate) fn reveal(&self) -> &str {
        &self.0
    }

    /// `text` without the secret in it: servers like to repeat what they were given.
    pub(crate) fn redact(&self, text: &str) -> String {
        if self.0.len() < 4 {
            return text.to_owned();
        }
        text.replace(&self.0, "[key]")
    }

    /// The same for what may be no text. A picture in which the key stood cannot be read afterwards, and is refused.
    pub(crate) fn redact_bytes(&self, bytes: Vec<u8>) -> Vec<u8> {
        let key = self.0.as_bytes();
        let found = |bytes: &[u8]| bytes.windows(key.len()).position(|window| window == key);
        if key.len() < 4 || found(&bytes).is_none() {
            return bytes;
        }
        let (mut out, mut rest) = (Vec::with_capacity(bytes.len()), &bytes[..]);
        while let Some(at) = found(rest) {
            out.extend_from_slice(&rest[..at]);
            out.extend_from_slice(b"[key]");
            rest = &rest[at + key.len()..];
        }
        out.extend_from_slice(rest);
        out
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("[key]")
    }
}

/// A kind of service, and with it the names of its variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// OpenAI-compatible `images/edits`: `GEAR_IMAGES_URL`, `GEAR_IMAGES_MODEL`, `GEAR_IMAGES_KEY`.
    Images,
    /// A ComfyUI server: `GEAR_COMFYUI_URL`, `GEAR_COMFYUI_MODEL` (a name for what its workflow uses), `GEAR_COMFYUI_KEY`.
    ComfyUi,
    /// OpenAI-compatible `chat/completions` with pictures: `GEAR_CHAT_URL`, `GEAR_CHAT_MODEL`, `GEAR_CHAT_KEY`.
    Chat,
}

impl Kind {
    fn prefix(self) -> &'static str {
        match self {
            Self::Images => "GEAR_IMAGES",
            Self::ComfyUi => "GEAR_COMFYUI",
            Self::Chat => "GEAR_CHAT",
        }
    }

    fn what(self) -> &'static str {
        match self {
            Self::Images => "image-editing service",
            Self::ComfyUi => "ComfyUI server",
            Self::Chat => "chat service",
        }
    }

    /// The model that is named when none is set; `None` where one must be.
    fn default_model(self) -> Option<&'static str> {
        match self {
            Self::ComfyUi => Some("comfyui"),
            Self::Images | Self::Chat => None,
        }
    }
}

/// A service: its address, model and key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Endpoint {
    /// `scheme://host[:port]/path`, without a slash at its end.
    base: String,
    scheme_and_host: String,
    /// The model that is asked for.
    model: String,
    key: Option<Secret>,
}

impl Endpoint {
    /// Reads the variables of a service. `get` is the environment.
    pub fn from_env(kind: Kind, get: &dyn Fn(&str) -> Option<String>) -> Result<Self, ServiceError> {
        let name = |what: &str| format!("{}_{what}", kind.prefix());
        let read = |what: &str| {
            get(&name(what))
                .map(|text| text.trim().to_owned())
                .filter(|text| !text.is_empty())
        };
        let not_set = |what: &str, help: &str| ServiceError::NotSetUp {
            what: kind.what(),
            name: name(what),
            help: help.to_owned(),
        };
        let url = read("URL").ok_or_else(|| {
            not_set(
                "URL",
                "set it to the service's address, such as https://api.example.org/v1 (a key goes into the variable that \
                 ends in _KEY, the model into _MODEL)",
            )
        })?;
        let model = match (read("MODEL"), kind.default_model()) {
            (Some(model), _) => model,
            (None, Some(model)) => model.to_owned(),
            (None, None) => {
                return Err(not_set(
                    "MODEL",
                    "set it to the name of the model, as the service knows it",
                ));
            }
        };
        Self::new(&url, model, read("KEY")).map_err(|problem| ServiceError::Address {
            name: name("URL"),
            problem,
        })
    }

    /// A service at `url`. The error says what is wrong with the address.
    pub fn new(url: &str, model: impl Into<String>, key: Option<String>) -> Result<Self, String> {
        let uri: ureq::http::Uri = url.parse().map_err(|error| {
            format!("found an address that cannot be read ({error}); expected one like https://api.example.org/v1")
        })?;
        let (Some(scheme), Some(authority)) = (uri.scheme_str(), uri.authority()) else {
            return Err("found no scheme and host; expected an address like https://api.example.org/v1".to_owned());
        };
        if authority.as_str().contains('@') {
            return Err("found a user in the address; a key goes into the variable that ends in _KEY".to_owned());
        }
        if uri.query().is_some() {
            return Err("found a query in the address; expected scheme, host and path".to_owned());
        }
        match scheme {
            "https" => {}
            "http" if key.is_none() || is_loopback(authority.host()) => {}
            "http" => {
                return Err(
                    "found http:// and a key; a key is sent by https:// only, except to this machine".to_owned(),
                );
            }
            other => {
                return Err(format!(
                    "found the scheme `{other}`; expected https, or http for this machine"
                ));
            }
        }
        let scheme_and_host = format!("{scheme}://{authority}");
        Ok(Self {
            base: format!("{scheme_and_host}{}", uri.path().trim_end_matches('/')),
            scheme_and_host,
            model: model.into(),
            key: key.map(Secret),
        })
    }

    /// The model that is asked for.
    pub fn model(&self) -> &str {
        &self.model
    }

    /// Scheme, host and port, as errors name the service.
    pub fn host(&self) -> &str {
        &self.scheme_and_host
    }

    /// The address of a path below the service's own.
    pub(crate) fn join(&self, path: &str) -> String {
        format!("{}{path}", self.base)
    }

    /// Whether an address is on the service's own host.
    pub(crate) fn owns(&self, address: &str) -> bool {
        let Ok(uri) = address.parse::<ureq::http::Uri>() else {
            return false;
        };
        match (uri.scheme_str(), uri.authority()) {
            (Some(scheme), Some(authority)) => format!("{scheme}://{authority}") == self.scheme_and_host,
            // A path alone is on the same host; `//host/path` has an authority and no scheme.
            (None, None) => address.starts_with('/') && !address.starts_with("//"),
            _ => false,
        }
    }

    /// The whole address of one that may be a path alone.
    pub(crate) fn absolute(&self, address: &str) -> String {
        if address.starts_with('/') {
            format!("{}{address}", self.scheme_and_host)
        } else {
            address.to_owned()
        }
    }

    pub(crate) fn key(&self) -> Option<&Secret> {
        self.key.as_ref()
    }

    /// `bytes` without the key.
    pub(crate) fn redact_bytes(&self, bytes: Vec<u8>) -> Vec<u8> {
        match &self.key {
            Some(key) => key.redact_bytes(bytes),
            None => bytes,
        }
    }

    /// `text` without the key.
    pub(crate) fn redact(&self, text: &str) -> String {
        match &self.key {
            Some(key) => key.redact(text),
            None => text.to_owned(),
        }
    }
}

fn is_loopback(host: &str) -> bool {
    let host = host.trim_start_matches('[').trim_end_matches(']');
    host == "localhost"
        || host
            .parse::<std::net::IpAddr>()
            .is_ok_and(|address| address.is_loopback())
}

/// The services that a run lends to its nodes.
#[derive(Clone, Debug, Default)]
pub struct Services {
    found: Vec<(Kind, Endpoint)>,
    missing: Vec<(Kind, String)>,
}

impl Services {
    /// What the process's environment says.
    pub fn from_process() -> Self {
        Self::from_env(&|name| std::env::var(name).ok())
    }

    /// What an environment says.
    pub fn from_env(get: &dyn Fn(&str) -> Option<String>) -> Self {
        let mut services = Self::default();
        for kind in [Kind::Images, Kind::ComfyUi, Kind::Chat] {
            match Endpoint::from_env(kind, get) {
                Ok(endpoint) => services.found.push((kind, endpoint)),
                Err(error) => services.missing.push((kind, error.to_string())),
            }
        }
        services
    }

    /// What a run lends; outside of a run, what the process's environment says.
    pub fn lent(resources: &gear_graph::Resources) -> Self {
        resources.get::<Self>().cloned().unwrap_or_else(Self::from_process)
    }

    /// With a service, in place of what the environment says.
    pub fn with(mut self, kind: Kind, endpoint: Endpoint) -> Self {
        self.found.retain(|(other, _)| *other != kind);
        self.found.push((kind, endpoint));
        self
    }

    /// A service, or a sentence on why there is none.
    pub fn get(&self, kind: Kind) -> Result<&Endpoint, String> {
        if let Some((_, endpoint)) = self.found.iter().find(|(other, _)| *other == kind) {
            return Ok(endpoint);
        }
        let missing = self.missing.iter().find(|(other, _)| *other == kind);
        Err(missing.map_or_else(
            || format!("no {} is lent to this run", kind.what()),
            |(_, why)| why.clone(),
        ))
    }

    /// Where the answers of a service are valid: `service:MODEL`.
    pub fn realm(&self, kind: Kind) -> String {
        format!("service:{}", self.get(kind).map_or("none", Endpoint::model))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn env<'a>(pairs: &'a [(&'a str, &'a str)]) -> impl Fn(&str) -> Option<String> + 'a {
        move |name| {
            let found = pairs.iter().find(|(n, _)| *n == name);
            found.map(|(_, value)| (*value).to_owned())
        }
    }

    #[test]
    fn what_is_missing_is_named() {
        let none = Endpoint::from_env(Kind::Images, &env(&[])).unwrap_err();
        assert!(none.to_string().contains("GEAR_IMAGES_URL is not set"), "{none}");
        let url = [("GEAR_CHAT_URL", "https://a.example/v1")];
        let model = Endpoint::from_env(Kind::Chat, &env(&url)).unwrap_err();
        assert!(model.to_string().contains("GEAR_CHAT_MODEL"), "{model}");
        let comfy = Endpoint::from_env(Kind::ComfyUi, &env(&[("GEAR_COMFYUI_URL", "http://127.0.0.1:8188/")])).unwrap();
        assert_eq!(
            (comfy.model(), comfy.join("/prompt")),
            ("comfyui", "http://127.0.0.1:8188/prompt".to_owned())
        );
    }

    #[test]
    fn a_key_goes_over_tls_or_to_this_machine() {
        let key = || Some("sk-12345".to_owned());
        for good in [
            "https://a.example/v1/",
            "http://localhost:1",
            "http://127.0.0.1:9",
            "http://[::1]:9",
        ] {
            assert!(Endpoint::new(good, "m", key()).is_ok(), "{good}");
        }
        for bad in [
            "http://a.example",
            "ftp://a.example",
            "a.example/v1",
            "https://user@a.example",
            "https://a.example/?q",
            "",
            "http://127.0.0.1.example",
        ] {
            assert!(Endpoint::new(bad, "m", key()).is_err(), "{bad}");
        }
        assert!(Endpoint::new("http://192.168.1.5:8188", "m", None).is_ok());
    }

    #[test]
    fn a_key_never_shows() {
        let endpoint = Endpoint::new("https://a.example", "m", Some("sk-12345".into())).unwrap();
        assert!(!format!("{endpoint:?}").contains("12345"));
        assert_eq!(endpoint.redact("bad key sk-12345!"), "bad key [key]!");
        assert_eq!(
            endpoint.redact_bytes(b"\xffsk-12345sk-1234\0sk-12345".to_vec()),
            b"\xff[key]sk-1234\0[key]"
        );
    }

    #[test]
    fn only_its_own_host_is_its_own() {
        let endpoint = Endpoint::new("https://a.example/v1", "m", None).unwrap();
        for own in ["https://a.example/file", "/file"] {
            assert!(endpoint.owns(own), "{own}");
        }
        for other in [
            "https://b.example/",
            "http://a.example/",
            "https://a.example:444/",
            "//b.example/x",
            "file:///etc",
        ] {
            assert!(!endpoint.owns(other), "{other}");
        }
    }
}
