#![allow(missing_docs)]
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::*;
fn main(){ let a:Vec<String>=std::env::args().collect(); let seed:u64=a[2].parse().unwrap();
 let kinds=if a[1]=="none"{vec![]}else{a[1].split('+').map(|k|EffectKind::from_name(k).unwrap()).collect()};
 let s=simulate(&SimulatorSettings::new(seed, EffectRequest::Kinds(kinds)));
 let p=std::path::PathBuf::from(&a[3]); dataset_writer::write_dataset(&s,&p).unwrap(); dataset_writer::write_truth(&s,&p.join("../truth.json").as_path()).unwrap_or(()); std::fs::write(format!("{}.truth.json",a[3]), format!("{:#}", s.truth_json())).unwrap(); }
