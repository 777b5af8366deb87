function test_stylet(recording, bytes)
  % test_stylet(RECORDING, BYTES) steps through a recording.csv at once, by halves and sample by sample, which must agree, and writes the
  % enhanced force as 64-bit floats to the file BYTES.
  file = fopen(recording);
  names = strsplit(strtrim(fgetl(file)), ',');
  text = strsplit(strtrim(fread(file, [1 Inf], '*char')), {',', sprintf('\n')});
  fclose(file);
  table = reshape(str2double(text), numel(names), []).';
  column = @(name) table(:, strcmp(names, name));
  t = column('time_s'); z = column('position_m'); v = column('velocity_mps'); f = column('force_n');

  core = StyletEnhancer();
  out = core.step(t, z, v, f);
  half = floor(numel(t) / 2);
  core = StyletEnhancer(struct('samples', 100));
  first = core.step(t(1:half), z(1:half), v(1:half), f(1:half));
  second = core.step(t(half+1:end), z(half+1:end), v(half+1:end), f(half+1:end));
  assert(isequal([first.enhanced_n; second.enhanced_n], out.enhanced_n));
  core = StyletEnhancer();
  for k = 1:half
    one = core.step(t(k), z(k), v(k), f(k));
    assert(one.enhanced_n == out.enhanced_n(k));
  end
  assert(all(out.used) && out.ruptures(end) == sum(out.ruptured));

  assert_error(@() StyletEnhancer(struct('forgetting', 2)), 'forgetting');
  assert_error(@() StyletEnhancer(struct('colour', 1)), 'colour');
  assert_error(@() core.step(t, z, v, f(1:3)), 'equal length');
  delete(core);
  assert_error(@() core.step(0, 0, 0, 0), 'handle');

  file = fopen(bytes, 'w');
  fwrite(file, out.enhanced_n, 'double', 0, 'ieee-le');
  fclose(file);
  disp(sprintf('%d samples, %d ruptures', numel(t), out.ruptures(end)));
end

function assert_error(call, named)
  try
    call();
  catch problem
    assert(~isempty(strfind(problem.message, named)), problem.message);
    return;
  end
  error('no error names %s', named);
end
