//! Recordings that other tools have rewritten.

use std::collections::HashMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use dynocar_mcap::copying::recover;
use dynocar_mcap::error::CopyError;
use dynocar_mcap::reading::{ChannelInfo, Raw, RecordingItem, Visitor, read};
use dynocar_mcap::recording::Recording;
use dynocar_workshop::convert::{ModelFiles, to_dataset};
use dynocar_workshop::dataset::from_dataset;
use mcap::records::MessageHeader;
use mcap::{Attachment, Compression, WriteOptions, Writer};

const DEMO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/demo");

/// Another tool: it copies the attachments and the first messages into a new file and drops the rest.
struct Tool {
    writer: Writer<BufWriter<File>>,
    channels: HashMap<String, u16>,
    messages_left: usize,
    keeps_metadata: bool,
}

impl Visitor for Tool {
    type Error = CopyError;

    fn item(&mut self, item: RecordingItem<'_>) -> Result<(), CopyError> {
        if let RecordingItem::Attachment { name, log_time, media_type, content } = item {
            let (create_time, data) = (log_time, content.into());
            let it = Attachment { log_time, create_time, name, media_type, data };
            self.writer.attach(&it).unwrap();
        }
        Ok(())
    }

    fn raw(&mut self, raw: &Raw<'_>) -> Result<(), CopyError> {
        if self.messages_left == 0 {
            return Ok(());
        }
        self.messages_left -= 1;
        let ChannelInfo { topic, encoding, metadata, schema } = raw.channel;
        let (writer, keeps) = (&mut self.writer, self.keeps_metadata);
        let channel_id = *self.channels.entry(topic.clone()).or_insert_with(|| {
            let (name, of, data) = schema.as_ref().unwrap();
            let schema = writer.add_schema(name, of, data).unwrap();
            let metadata = if keeps { metadata.clone() } else { Default::default() };
            writer.add_channel(schema, topic, encoding, &metadata).unwrap()
        });
        let header = MessageHeader { channel_id, ..raw.header };
        self.writer.write_to_known_channel(&header, raw.data).unwrap();
        Ok(())
    }
}

fn rewritten(
    from: &Path,
    to: &Path,
    compression: Option<Compression>,
    (messages_left, keeps_metadata): (usize, bool),
) {
    let file = BufWriter::new(File::create_new(to).unwrap());
    let writer = WriteOptions::new().compression(compression).create(file).unwrap();
    let mut tool = Tool { writer, channels: HashMap::new(), messages_left, keeps_metadata };
    read(from, &mut tool).unwrap();
    tool.writer.finish().unwrap();
}

#[test]
fn what_other_tools_compress_or_strip_is_read_and_what_they_cut_is_cut() {
    let site = tempfile::tempdir().unwrap();
    let at = |name: &str| -> PathBuf { site.path().join(name) };
    let whole = at("whole.mcap");
    let count = from_dataset(Path::new(DEMO), &whole).unwrap();
    let samples = Recording::load(&whole).unwrap().samples;
    for (name, compression, keeps_metadata) in [
        ("zstd", Some(Compression::Zstd), true),
        ("lz4", Some(Compression::Lz4), true),
        ("plain", None, false),
    ] {
        let other = at(&format!("{name}.mcap"));
        rewritten(&whole, &other, compression, (usize::MAX, keeps_metadata));
        assert_eq!(Recording::load(&other).unwrap().samples, samples, "{name}");
        let recovered =
            recover(std::slice::from_ref(&other), &at(&format!("{name}_again.mcap"))).unwrap();
        assert_eq!(recovered.messages as usize, count, "{name}");
        let folder = at(name);
        let unpacked = to_dataset(&[other], &folder, None, &ModelFiles::default()).unwrap();
        assert_eq!(unpacked.samples, count);
        // The dataset that is attached is taken as it is.
        let manifest = std::fs::read_to_string(folder.join("dataset.toml")).unwrap();
        assert_eq!(
            manifest,
            std::fs::read_to_string(Path::new(DEMO).join("dataset.toml")).unwrap()
        );
    }
    for messages in [100, 1, count - 1] {
        let (cut, folder) = (at(&format!("cut{messages}.mcap")), at(&format!("cut{messages}")));
        rewritten(&whole, &cut, None, (messages, true));
        let unpacked = to_dataset(&[cut], &folder, None, &ModelFiles::default()).unwrap();
        assert_eq!(unpacked.samples, messages);
        let dataset = dynocar::dataset::load(&folder).unwrap();
        let left: usize = dataset.runs.iter().map(|run| run.samples.len()).sum();
        assert_eq!(left, messages);
        assert_eq!(
            dataset.train.mass_kg,
            dynocar::dataset::load(Path::new(DEMO)).unwrap().train.mass_kg
        );
    }
}
