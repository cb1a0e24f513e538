//! Sparkplug B's payload as protobuf messages: of the specification's fields those that are written here.
//!
//! Field numbers and types are those of the Sparkplug specification 3.0.0, chapter 6.4.1; fields that are not
//! declared here are passed over when a payload is read.

use std::borrow::Cow;
use std::time::SystemTime;

/// Sparkplug's numbers of the types that are used here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum DataType {
    /// Unsigned, 64 bits.
    UInt64 = 8,
    /// A double.
    Double = 10,
    /// True or false.
    Boolean = 11,
    /// Text.
    String = 12,
}

/// What is published under a topic.
#[derive(Clone, PartialEq, prost::Message)]
pub struct Payload {
    /// When it was made, in ms since 1970, UTC.
    #[prost(uint64, optional, tag = "1")]
    pub timestamp: Option<u64>,
    /// The metrics.
    #[prost(message, repeated, tag = "2")]
    pub metrics: Vec<Metric>,
    /// Number of the message within the node's session, 0 to 255, then 0 again.
    #[prost(uint64, optional, tag = "3")]
    pub seq: Option<u64>,
}

/// A named value.
#[derive(Clone, PartialEq, prost::Message)]
pub struct Metric {
    /// The name; in births, for data have the alias.
    #[prost(string, optional, tag = "1")]
    pub name: Option<String>,
    /// The number that stands for the name.
    #[prost(uint64, optional, tag = "2")]
    pub alias: Option<u64>,
    /// When the value was taken, in ms since 1970, UTC.
    #[prost(uint64, optional, tag = "3")]
    pub timestamp: Option<u64>,
    /// [`DataType`] by number; in births.
    #[prost(uint32, optional, tag = "4")]
    pub datatype: Option<u32>,
    /// True for a value that waited while the broker was away.
    #[prost(bool, optional, tag = "5")]
    pub is_historical: Option<bool>,
    /// True where there is no value.
    #[prost(bool, optional, tag = "7")]
    pub is_null: Option<bool>,
    /// What it means; in births.
    #[prost(message, optional, tag = "8")]
    pub metadata: Option<MetaData>,
    /// Properties; in births.
    #[prost(message, optional, tag = "9")]
    pub properties: Option<PropertySet>,
    /// The value.
    #[prost(oneof = "MetricValue", tags = "11, 13, 14, 15")]
    pub value: Option<MetricValue>,
}

/// A value by its type.
#[derive(Clone, PartialEq, prost::Oneof)]
pub enum MetricValue {
    /// Of a [`DataType::UInt64`].
    #[prost(uint64, tag = "11")]
    Long(u64),
    /// Of a [`DataType::Double`].
    #[prost(double, tag = "13")]
    Double(f64),
    /// Of a [`DataType::Boolean`].
    #[prost(bool, tag = "14")]
    Boolean(bool),
    /// Of a [`DataType::String`].
    #[prost(string, tag = "15")]
    Text(String),
}

/// What is said of a metric.
#[derive(Clone, PartialEq, prost::Message)]
pub struct MetaData {
    /// What it means.
    #[prost(string, optional, tag = "8")]
    pub description: Option<String>,
}

/// Properties of a metric: names and as many values.
#[derive(Clone, PartialEq, prost::Message)]
pub struct PropertySet {
    /// The names.
    #[prost(string, repeated, tag = "1")]
    pub keys: Vec<String>,
    /// The values.
    #[prost(message, repeated, tag = "2")]
    pub values: Vec<PropertyValue>,
}

/// A property's value.
#[derive(Clone, PartialEq, prost::Message)]
pub struct PropertyValue {
    /// [`DataType`] by number.
    #[prost(uint32, optional, tag = "1")]
    pub r#type: Option<u32>,
    /// The value.
    #[prost(oneof = "TextValue", tags = "8")]
    pub value: Option<TextValue>,
}

/// The only type of a property that is written here.
#[derive(Clone, PartialEq, prost::Oneof)]
pub enum TextValue {
    /// Text.
    #[prost(string, tag = "8")]
    Text(String),
}

/// A value that may be missing.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A count.
    Count(Option<u64>),
    /// A number.
    Number(Option<f64>),
    /// A switch.
    Switch(bool),
    /// Words.
    Words(Option<Cow<'static, str>>),
}

impl Value {
    /// Words that are there.
    pub fn words(words: impl Into<Cow<'static, str>>) -> Self {
        Value::Words(Some(words.into()))
    }

    /// The same without a value.
    pub fn missing(&self) -> Self {
        match self {
            Value::Count(_) => Value::Count(None),
            Value::Number(_) => Value::Number(None),
            Value::Switch(_) => Value::Switch(false),
            Value::Words(_) => Value::Words(None),
        }
    }

    /// Its type, and itself where it is there.
    fn on_the_wire(&self) -> (DataType, Option<MetricValue>) {
        match self {
            Value::Count(it) => (DataType::UInt64, it.map(MetricValue::Long)),
            Value::Number(it) => (DataType::Double, it.map(MetricValue::Double)),
            Value::Switch(it) => (DataType::Boolean, Some(MetricValue::Boolean(*it))),
            Value::Words(it) => {
                (DataType::String, it.as_ref().map(|it| MetricValue::Text(it.to_string())))
            }
        }
    }

    /// A metric of a birth: all that is known of it.
    pub fn born(
        &self,
        name: &str,
        alias: Option<u64>,
        unit: &str,
        meaning: &str,
        ms: u64,
    ) -> Metric {
        let text = |words: &str| (!words.is_empty()).then(|| words.to_owned());
        let of_unit = |unit| PropertySet {
            keys: vec!["engUnit".into()],
            values: vec![PropertyValue {
                r#type: Some(DataType::String as u32),
                value: Some(TextValue::Text(unit)),
            }],
        };
        Metric {
            name: Some(name.into()),
            datatype: Some(self.on_the_wire().0 as u32),
            metadata: text(meaning).map(|it| MetaData { description: Some(it) }),
            properties: text(unit).map(of_unit),
            alias,
            ..self.changed(0, ms)
        }
    }

    /// A metric of data: alias, time and value.
    pub fn changed(&self, alias: u64, ms: u64) -> Metric {
        let (_, value) = self.on_the_wire();
        Metric {
            alias: Some(alias),
            timestamp: Some(ms),
            is_null: value.is_none().then_some(true),
            value,
            ..Metric::default()
        }
    }
}

/// The host's time in ms since 1970, UTC.
pub fn utc_ms() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |it| it.as_millis() as u64)
}
