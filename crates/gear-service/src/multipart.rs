//! The body of an upload: `multipart/form-data` (RFC 7578).

/// A form that is being filled in.
pub struct Form {
    boundary: String,
    body: Vec<u8>,
}

impl Form {
    /// An empty form. `content` is anything that the parts are made of: the boundary must not occur in it.
    pub fn new(content: &[u8]) -> Self {
        // A digest of the content is not in it, for all that anybody can find out.
        let digest = gear_graph::Digest::of(content).hex();
        Self {
            boundary: format!("gear-{}", &digest[..32]),
            body: Vec::new(),
        }
    }

    /// A field with a text.
    pub fn text(&mut self, name: &str, value: &str) -> &mut Self {
        self.head(name, None);
        self.body.extend_from_slice(value.as_bytes());
        self.body.extend_from_slice(b"\r\n");
        self
    }

    /// A field with a PNG file.
    pub fn png(&mut self, name: &str, file_name: &str, bytes: &[u8]) -> &mut Self {
        self.head(name, Some(file_name));
        self.body.extend_from_slice(bytes);
        self.body.extend_from_slice(b"\r\n");
        self
    }

    fn head(&mut self, name: &str, file: Option<&str>) {
        let mut head = format!("--{}\r\nContent-Disposition: form-data; name=\"{name}\"", self.boundary);
        if let Some(file) = file {
            head.push_str(&format!("; filename=\"{file}\"\r\nContent-Type: image/png"));
        }
        head.push_str("\r\n\r\n");
        self.body.extend_from_slice(head.as_bytes());
    }

    /// The content type and the whole body.
    pub fn finish(mut self) -> (String, Vec<u8>) {
        self.body
            .extend_from_slice(format!("--{}--\r\n", self.boundary).as_bytes());
        (format!("multipart/form-data; boundary={}", self.boundary), self.body)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_stand_between_boundaries() {
        let mut form = Form::new(b"x");
        form.text("prompt", "marble, é").png("image", "image.png", b"\x89PNG");
        let (kind, body) = form.finish();
        let boundary = kind.strip_prefix("multipart/form-data; boundary=").unwrap().to_owned();
        let text = String::from_utf8_lossy(&body).into_owned();
        assert!(text.starts_with(&format!(
            "--{boundary}\r\nContent-Disposition: form-data; name=\"prompt\"\r\n\r\nmarble, é\r\n"
        )));
        assert!(text.contains("name=\"image\"; filename=\"image.png\"\r\nContent-Type: image/png\r\n\r\n"));
        assert!(text.ends_with(&format!("\r\n--{boundary}--\r\n")));
    }
}
