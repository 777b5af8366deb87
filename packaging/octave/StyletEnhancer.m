classdef StyletEnhancer < handle
  % Online identification of layered tissue and force enhancement.
  %
  %   core = StyletEnhancer();                         % default configuration
  %   core = StyletEnhancer(struct('contact_known', 1, 'surface_m', 0.01));
  %   out = core.step(time_s, position_m, velocity_mps, force_n);
  %   plot(position_m, force_n, position_m, out.enhanced_n)
  %
  % `step` takes one sample or columns of samples, and goes on where the last call ended. Times in s increase; position in m, positive into
  % the tissue; velocity in m/s; force in N, positive when it resists. `out` is a struct of columns: enhanced_n, low_n, high_n,
  % reconstructed_n, error_n, stiffness_n_per_m, friction, cumulative_friction_ns_per_m, contact_m, state, ruptures, ruptured, used.
  % The configuration has the fields of StyletConfig in stylet.h, and `samples`, the samples of a layer that Paper stores.
  % Build once with `stylet_build(PREFIX)`. Research software, not a medical device.

  properties (Access = private)
    handle_ = uint64(0)
  end

  methods
    function self = StyletEnhancer(config)
      if nargin < 1
        config = struct();
      end
      self.handle_ = stylet_mex('new', config);
    end

    function out = step(self, time_s, position_m, velocity_mps, force_n)
      out = stylet_mex('step', self.handle_, time_s, position_m, velocity_mps, force_n);
    end

    function delete(self)
      if self.handle_ ~= 0
        stylet_mex('free', self.handle_);
        self.handle_ = uint64(0);
      end
    end
  end
end
