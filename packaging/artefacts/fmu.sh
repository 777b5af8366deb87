# FMUs (FMI 2.0, co-simulation) of the online core and of the tissue, over the C library.
prefix="$temporary/fmu_c_library"
make() {
    [ "$triple" = x86_64-unknown-linux-gnu ] || skip "the FMUs are built for x86_64 Linux only"
    need cc "a C compiler"
    crates/capi/install.sh "$prefix"
    local model
    for model in enhancer tissue; do
        SOURCE_DATE_EPOCH=$commit_time "$python" packaging/fmu/build.py "$model" "$prefix" "$out/stylet-$model-$version.fmu"
        made "$out/stylet-$model-$version.fmu"
    done
}
check() {
    hash_is "$("$python" packaging/fmu/test_fmus.py "$out/stylet-enhancer-$version.fmu" "$out/stylet-tissue-$version.fmu" "$recording" "$prefix")"
    installed "run by FMPy $("$python" -c 'import fmpy; print(fmpy.__version__)'); tissue bitwise as the C library"
}
