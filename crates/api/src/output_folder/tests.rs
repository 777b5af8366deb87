use super::*;

struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("stylet-folder-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        Self(path)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

const NAMES: [&str; 3] = ["a.csv", "b.json", "c.html"];

fn set(of: &str) -> Vec<(&'static str, Vec<u8>)> {
    NAMES.iter().map(|name| (*name, format!("{of} {name}").into_bytes())).collect()
}

/// The set in the folder; `None` for a mixture.
fn set_in(folder: &Path) -> Option<String> {
    let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap_or_default();
    let of = read(NAMES[0]).split(' ').next().unwrap_or_default().to_owned();
    let all = NAMES
        .iter()
        .all(|name| read(name) == format!("{of} {name}") || (of.is_empty() && read(name).is_empty()));
    (all && verify_manifest(folder, &NAMES).is_ok()).then_some(of)
}

fn leftovers(folder: &Path) -> Vec<String> {
    let all = fs::read_dir(folder)
        .map(|all| all.flatten().map(|e| e.file_name().to_string_lossy().into_owned()).collect());
    all.map(|all: Vec<String>| all.into_iter().filter(|name| name.starts_with('.')).collect())
        .unwrap_or_default()
}

#[test]
fn killed_at_any_disk_operation_the_folder_holds_the_old_or_the_new_set() -> Result<(), Error> {
    let scratch = Scratch::new("kills");
    let (mut olds, mut news, mut at) = (0, 0, 0);
    loop {
        let folder = scratch.0.join(format!("{at}"));
        let old = [set("old"), vec![("only-old.svg", b"old".to_vec())]].concat();
        OutputLock::new(&folder)?.write_set(&[], &old, &Inputs::default())?;
        fs::write(folder.join("notes.txt"), "mine").map_err(|e| failed(&folder, e))?;
        let lock = OutputLock::new(&folder)?;
        let mut left = at;
        // Every other time the first file is staged in pieces.
        let (parts, files) = if at % 2 == 0 {
            let (name, content) = &set("new")[0];
            let mut part = lock.stage_file(name)?;
            content.chunks(3).try_for_each(|piece| part.write_all(piece)).map_err(|e| failed(&folder, e))?;
            (vec![part.finish()?], set("new").split_off(1))
        } else {
            (Vec::new(), set("new"))
        };
        let done = lock.write_until(&parts, &files, Manifest::default(), &mut || {
            left -= 1;
            left < 0
        });
        drop(lock);
        recover(&folder)?;
        let now = set_in(&folder);
        assert!(matches!(now.as_deref(), Some("old" | "new")), "killed at change {at}: {now:?}");
        let is_old = now.as_deref() == Some("old");
        assert_eq!(folder.join("only-old.svg").exists(), is_old, "killed at change {at}");
        if is_old {
            olds += 1;
        } else {
            news += 1;
        }
        // The next set removes what a kill left.
        OutputLock::new(&folder)?.write_set(&[], &set("next"), &Inputs::default())?;
        assert_eq!(
            (set_in(&folder).as_deref(), leftovers(&folder)),
            (Some("next"), vec![]),
            "killed at change {at}"
        );
        assert_eq!(fs::read_to_string(folder.join("notes.txt")).unwrap_or_default(), "mine");
        if done.is_ok() {
            break;
        }
        at += 1;
    }
    assert!(olds >= 5 && news >= 8, "the kills fell on both sides: {olds} old, {news} new");
    Ok(())
}

#[test]
fn a_move_that_fails_anywhere_is_undone() -> Result<(), Error> {
    let scratch = Scratch::new("back");
    let mut taken_back = 0;
    for at in 0..40 {
        let folder = scratch.0.join(format!("{at}"));
        let old = [set("old"), vec![("only-old.svg", b"old".to_vec())]].concat();
        OutputLock::new(&folder)?.write_set(&[], &old, &Inputs::default())?;
        let mut left = at;
        let new = [set("new"), vec![("only-new.svg", b"new".to_vec())]].concat();
        let lock = OutputLock::new(&folder)?;
        let _ = lock.write_until(&[], &new, Manifest::default(), &mut || {
            left -= 1;
            left < 0
        });
        // Committed.
        if !folder.join(COMPLETE_FOLDER).exists() {
            continue;
        }
        taken_back += 1;
        let names = new.iter().map(|(name, _)| *name).chain([MANIFEST]);
        restore_old(&folder, names)
            .and_then(|()| remove_staging(&folder, &mut || false))
            .map_err(|e| failed(&folder, e))?;
        assert_eq!((set_in(&folder).as_deref(), leftovers(&folder)), (Some("old"), vec![]), "at {at}");
        assert!(!folder.join("only-new.svg").exists(), "at {at}: a file of the set that was given up");
        assert!(folder.join("only-old.svg").exists(), "at {at}: a file of the old set");
    }
    assert!(taken_back > 8, "{taken_back}");
    Ok(())
}

/// A file that only the old set has goes with it, unless it was changed or is an input of the command that writes the new set.
#[test]
fn a_file_that_the_new_set_lacks_is_removed() -> Result<(), Error> {
    let scratch = Scratch::new("superseded");
    let optional = scratch.0.join("optional.ron");
    let with_optional = [set("old"), vec![("optional.ron", b"old".to_vec())]].concat();
    let write = |set: &[(&'static str, Vec<u8>)], inputs: &[&Path]| {
        let files = inputs.iter().map(|path| path.to_path_buf()).collect();
        OutputLock::new(&scratch.0)?.write_set(&[], set, &Inputs { files, names_folder: None })
    };
    write(&with_optional, &[])?;
    write(&set("new"), &[])?;
    assert!(!optional.exists());
    // An input stays and belongs to the folder: the next set may replace it.
    write(&with_optional, &[])?;
    write(&set("new"), &[&optional])?;
    assert!(optional.exists());
    write(&with_optional, &[])?;
    // A changed file is the user's.
    fs::write(&optional, "mine").map_err(|e| failed(&optional, e))?;
    write(&set("new"), &[])?;
    assert_eq!(fs::read_to_string(&optional).unwrap_or_default(), "mine");
    let refused = write(&with_optional, &[]).expect_err("it would be lost").to_string();
    assert!(refused.contains("optional.ron"), "{refused}");
    // A manifest that names a file elsewhere does not reach it.
    let elsewhere = Scratch::new("elsewhere");
    fs::write(&elsewhere.0, "other").map_err(|e| failed(&elsewhere.0, e))?;
    let name = format!("../{}", elsewhere.0.file_name().unwrap_or_default().to_string_lossy());
    let mut manifest = superseded::manifest_in(&scratch.0);
    manifest.sha256.insert(name, sha256(b"other"));
    let text = serde_json::to_vec(&manifest).unwrap_or_default();
    fs::write(scratch.0.join(MANIFEST), text).map_err(|e| failed(&scratch.0, e))?;
    write(&set("newer"), &[])?;
    assert_eq!(fs::read_to_string(&elsewhere.0).unwrap_or_default(), "other");
    let _ = fs::remove_file(&elsewhere.0);
    Ok(())
}

#[test]
fn two_commands_cannot_lock_one_folder_but_shards_can() -> Result<(), Error> {
    let scratch = Scratch::new("lock");
    let first = OutputLock::new(&scratch.0)?;
    for second in [OutputLock::new(&scratch.0), OutputLock::lock_shared(&scratch.0)] {
        let message = second.map(|_| ()).expect_err("it is taken").to_string();
        assert!(message.contains("another stylet") && message.contains("--out"), "{message}");
    }
    drop(first);
    let (one, two) = (OutputLock::lock_shared(&scratch.0)?, OutputLock::lock_shared(&scratch.0)?);
    assert!(OutputLock::new(&scratch.0).is_err(), "shards are being written");
    drop((one, two));
    assert!(!scratch.0.exists(), "a folder that was made and stayed empty goes again");
    Ok(())
}

#[test]
fn a_staged_file_is_removed_with_the_lock() -> Result<(), Error> {
    let scratch = Scratch::new("begun");
    OutputLock::new(&scratch.0)?.write_set(&[], &set("old"), &Inputs::default())?;
    let lock = OutputLock::new(&scratch.0)?;
    lock.stage_file(NAMES[0])?.write_all(b"half").map_err(|e| failed(&scratch.0, e))?;
    assert_eq!(leftovers(&scratch.0), [STAGING_FOLDER]);
    drop(lock);
    assert_eq!((set_in(&scratch.0).as_deref(), leftovers(&scratch.0)), (Some("old"), vec![]));
    Ok(())
}

#[test]
fn a_changed_file_is_reported() -> Result<(), Error> {
    let scratch = Scratch::new("changed");
    OutputLock::new(&scratch.0)?.write_set(&[], &set("old"), &Inputs::default())?;
    assert!(verify_manifest(&scratch.0, &NAMES).is_ok());
    fs::write(scratch.0.join(NAMES[1]), "other").map_err(|e| failed(&scratch.0, e))?;
    let message = verify_manifest(&scratch.0, &NAMES).expect_err("b.json is another").to_string();
    assert!(message.contains("b.json") && message.contains("same set"), "{message}");
    Ok(())
}

#[test]
fn a_set_of_another_command_is_refused_and_the_folder_is_unchanged() -> Result<(), Error> {
    let scratch = Scratch::new("other-command");
    let run: Vec<(&'static str, Vec<u8>)> =
        ["report.html", "score.json"].map(|name| (name, b"of the run".to_vec())).to_vec();
    OutputLock::new(&scratch.0)?.write_set(&[], &run, &Inputs::default())?;
    let enhanced: Vec<(&'static str, Vec<u8>)> =
        ["report.html", "enhance.json"].map(|name| (name, b"enhanced".to_vec())).to_vec();
    let refused = OutputLock::new(&scratch.0)?.write_set(&[], &enhanced, &Inputs::default());
    let message = refused.expect_err("the folder holds a run").to_string();
    assert!(message.contains("stylet run") && message.contains("--out"), "{message}");
    verify_manifest(&scratch.0, &["report.html", "score.json"])?;
    // The same command replaces its own results.
    OutputLock::new(&scratch.0)?.write_set(&[], &run, &Inputs::default())
}
