function stylet_build(prefix)
  % stylet_build(PREFIX) compiles stylet_mex against the C library under PREFIX, beside this file. The library is linked statically.
  here = fileparts(mfilename('fullpath'));
  if ~exist(fullfile(prefix, 'include', 'stylet.h'), 'file')
    error('stylet:build', 'there is no include/stylet.h under %s: unpack the C library there', prefix);
  end
  source = fullfile(here, 'stylet_mex.c');
  include = ['-I' fullfile(prefix, 'include')];
  library = fullfile(prefix, 'lib', 'libstylet.a');
  if exist('OCTAVE_VERSION', 'builtin')
    mkoctfile('--mex', include, source, library, '-lm', '-lpthread', '-ldl', '-o', fullfile(here, ['stylet_mex.' mexext()]));
  else
    mex('-outdir', here, include, source, library);
  end
end
