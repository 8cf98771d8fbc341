// The traffic of radios.py on ns-3's CSMA channel, a bus that listens before it talks and knows no collisions.
namespace volery_bench {

using namespace ns3;

unsigned long heard = 0;

bool Hear(Ptr<NetDevice>, Ptr<const Packet>, uint16_t, const Address&) {
  ++heard;
  return true;
}

void Talk(Ptr<NetDevice> device, Ptr<ExponentialRandomVariable> silence, uint32_t size) {
  const uint16_t experimental = 0x88b5;
  device->Send(Create<Packet>(size), device->GetBroadcast(), experimental);
  Simulator::Schedule(Seconds(silence->GetValue()), &Talk, device, silence, size);
}

void Build(uint32_t count, double frames_per_second, uint32_t size, uint64_t bits_per_second) {
  NodeContainer nodes;
  nodes.Create(count);
  CsmaHelper helper;
  helper.SetChannelAttribute("DataRate", DataRateValue(DataRate(bits_per_second)));
  NetDeviceContainer devices = helper.Install(nodes);
  for (uint32_t node = 0; node < count; ++node) {
    devices.Get(node)->SetReceiveCallback(MakeCallback(&Hear));
    Ptr<ExponentialRandomVariable> silence = CreateObject<ExponentialRandomVariable>();
    silence->SetAttribute("Mean", DoubleValue(1 / frames_per_second));
    Simulator::Schedule(Seconds(silence->GetValue()), &Talk, devices.Get(node), silence, size);
  }
}

}  // namespace volery_bench
